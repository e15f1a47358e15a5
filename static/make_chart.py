"""Make the chart of docs/browser.md: quality of a capture's field against training time.

    python static/make_chart.py CAPTURE [SECONDS ...]

The numbers are kept in learning.json beside the chart. With SECONDS, only these times [s] are measured again; without,
those of `nerfnav bench`, which take 23 minutes. They are times of this machine as it is: let nothing else run on it.
"""

import argparse
import json
import os
from pathlib import Path

from nerfnav.core.errors import NerfnavError
from nerfnav.core.steps import run_steps
from nerfnav_app.jobs.measure.bench import SECONDS, Row, check_capture, measure_training, picture
from nerfnav_app.jobs.measure.results import png_of

NUMBERS = Path(__file__).with_name("learning.json")


def main(source: Path, seconds: tuple[float, ...]) -> None:
    """Learn the capture for each time, and write learning.json and learning.png beside this file."""
    check_capture(source, seconds)
    cores = len(os.sched_getaffinity(0))
    of: dict[str, str | int] = {"capture": source.name, "cores": cores}
    for budget in seconds:
        rows = run_steps(measure_training(source, (budget,)))
        rows += [row for row in measured_before(of) if row["budget_s"] != budget]
        rows.sort(key=lambda row: row["budget_s"] or 0.0)
        NUMBERS.write_text(json.dumps({**of, "rows": rows}, indent=1) + "\n")
        NUMBERS.with_suffix(".png").write_bytes(png_of(picture(rows, cores)))


def measured_before(of: dict[str, str | int]) -> list[Row]:
    """What was measured of this capture on as many cores; of another one, or on other cores, nothing is kept."""
    kept = json.loads(NUMBERS.read_text()) if NUMBERS.is_file() else {}
    return kept["rows"] if all(kept.get(name) == value for name, value in of.items()) else []


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("capture", type=Path)
    parser.add_argument("seconds", type=float, nargs="*", default=SECONDS)
    asked = parser.parse_args()
    try:
        main(asked.capture, tuple(asked.seconds))
    except NerfnavError as error:
        parser.error(str(error))

"""Make README's chart of how well a capture is learned in a given time, from trainings that it runs.

    python static/make_chart.py CAPTURE [SECONDS ...]

The numbers are kept in learning.json beside the chart. With SECONDS, only these times [s] are measured again; without,
those of `nerfnav bench`, which take 23 minutes. They are times of this machine as it is: let nothing else run on it.
"""

import json
import os
import sys
from pathlib import Path

from app.jobs.bench_chart import picture
from app.jobs.bench_training import SECONDS, check_capture, measure_training
from app.jobs.result_files import png_of
from nerfnav.steps import returned

NUMBERS = Path(__file__).with_name("learning.json")


def main(source: Path, seconds: tuple[float, ...]) -> None:
    """Learn the capture for each time, and write learning.json and learning.png beside this file."""
    check_capture(source, seconds)
    for budget in seconds:
        rows = returned(measure_training(source, (budget,)))
        before = json.loads(NUMBERS.read_text())["rows"] if NUMBERS.is_file() else []
        rows += [row for row in before if row["budget_s"] != budget]
        rows.sort(key=lambda row: row["budget_s"] or 0.0)
        cores = len(os.sched_getaffinity(0))
        NUMBERS.write_text(json.dumps({"capture": source.name, "cores": cores, "rows": rows}, indent=1) + "\n")
        NUMBERS.with_suffix(".png").write_bytes(png_of(picture(rows, cores)))


if __name__ == "__main__":
    main(Path(sys.argv[1]), tuple(float(each) for each in sys.argv[2:]) or SECONDS)

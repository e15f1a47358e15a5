"""Opening a file: wall time from a new process to what is shown, a plan, a flight, and the trained field."""

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from nerfnav.core.errors import InvalidInputError
from nerfnav.importers import SourceKind, source_kind
from nerfnav_app.benchmarks.house import write_house

BARS = {
    "baked": {"shown": 2.0, "planned": 8.0, "flown": 30.0},
    "fused": {"planned": 30.0},
    "draft": {"planned": 60.0},
    "video": {"planned": 180.0},
    "imported": {"planned": 15.0},
}
"""Times that a file may take on two cores, with compiled kernels, by the origin of its first field [s]: a mesh, RGB-D,
photographs, splats; and of a video, posing included."""
COLOR_S = 60.0
"""Time to learn colours, or to train a draft [s]."""
_CHILD = """
import json, sys
from pathlib import Path
from nerfnav_app.system import importing
with importing():  # as the page does
    import torch
    from nerfnav.core.errors import NerfnavError
    from nerfnav_app.jobs.open.timing import time_opening
torch.set_num_threads(1)
source, out, began, seconds = sys.argv[1:]
try:
    print(json.dumps(time_opening(Path(source), Path(out), float(began), float(seconds))))
except NerfnavError as error:
    print(json.dumps({"error": str(error)}))
"""


def measure(file: Path | None = None, seconds: float = COLOR_S) -> dict[str, dict[str, Any]]:
    """Times [s] of a file, or of a generated house of 20 m, by its name; `slow` names those that exceed `BARS`.

    Colours are learned, or a draft is trained, for `seconds`. Raises InvalidInputError for what cannot be opened.
    """
    with tempfile.TemporaryDirectory(prefix="nerfnav-") as folder:
        source = Path(folder) / "house.glb" if file is None else file
        if file is None:
            write_house(source)
        return {source.name: _in_a_new_process(source, Path(folder) / "field.npz", seconds)}


def _in_a_new_process(source: Path, out: Path, seconds: float) -> dict[str, Any]:
    words = [sys.executable, "-c", _CHILD, str(source), str(out), str(time.time()), str(seconds)]
    row = json.loads(subprocess.run(words, stdout=subprocess.PIPE, check=True).stdout.splitlines()[-1])
    if "error" in row:
        raise InvalidInputError(row["error"])
    bars = BARS["video"] if source_kind(source) is SourceKind.VIDEO else BARS.get(row["made_by"], {})
    return row | {"slow": [name for name, most in bars.items() if row[name] is None or row[name] > most]}

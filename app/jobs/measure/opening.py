"""Opening job: time how long files take to be shown, planned in, flown in, and trained."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from tyro.conf import Positional

from nerfnav.core.errors import InvalidInputError, require_positive
from nerfnav.importers import SourceKind, source_kind, wrong_kind_error
from nerfnav_app.benchmarks import opening
from nerfnav_app.jobs.events import JobEvents, JobResult, Progress

_KINDS = (SourceKind.MESH, SourceKind.CAPTURE, SourceKind.VIDEO, SourceKind.SPLATS)
_KNOWN = ("warehouse.glb", "redkitchen", "fox", "lego", "plush.splat", "splats/plush.splat")
"""Files that are timed by default, where there are any."""


@dataclass(frozen=True)
class OpeningRequest:
    """Request of the times of opening. The command line reads it as it is."""

    what: Positional[Literal["open"]]
    """Time the opening of files."""
    files: Positional[tuple[Path, ...]] = ()
    """Meshes, captures, videos or splats (default: a furnished house of 20 m, generated, and those of --data)."""
    data: Path | None = None
    """Folder with known files, of which those that it holds are timed too: warehouse.glb, redkitchen (RGB-D), fox,
    lego, plush.splat."""
    color_s: float = opening.COLOR_S
    """Time to learn colours, or to train a draft [s]."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for no time at all."""
        require_positive(color_s=self.color_s)


def run(request: OpeningRequest) -> JobEvents:
    """Yield which file is under way; return the times of each, by name.

    Raises NerfnavError for what is of no such kind, before anything is measured, and for what cannot be opened.
    """
    for file in request.files:
        if (kind := source_kind(file)) not in _KINDS:
            raise wrong_kind_error(file, kind, "a mesh, a capture, a video or splats")
    files = request.files or (None, *_known(request.data))
    names = [file.name for file in request.files]
    if len(set(names)) < len(names):
        raise InvalidInputError("two of the files have the same name: time them one after the other")
    rows = {}
    for index, file in enumerate(files):
        yield Progress(f"opening {'a house' if file is None else file.name}", index / len(files))
        rows |= opening.measure(file, request.color_s)
    return JobResult({"open": rows, "bars_s": opening.BARS})


def _known(folder: Path | None) -> list[Path]:
    """List the known files that a folder holds. Raises InvalidInputError where it holds none."""
    if folder is None:
        return []
    found = [folder / name for name in _KNOWN if (folder / name).exists()]
    if not found:
        raise InvalidInputError(f"{folder} holds none of {', '.join(_KNOWN)}")
    return found

"""Opening job: time how long meshes take to be shown, planned in, flown in, and learned in colour."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from tyro.conf import Positional

from nerfnav.core.errors import InvalidInputError, require_positive
from nerfnav.importers import SourceKind, source_kind, wrong_kind_error
from nerfnav_app.benchmarks import opening
from nerfnav_app.jobs.events import JobEvents, JobResult, Progress


@dataclass(frozen=True)
class OpeningRequest:
    """Request of the times of opening. The command line reads it as it is."""

    what: Positional[Literal["open"]]
    """Time the opening of meshes."""
    files: Positional[tuple[Path, ...]] = ()
    """Mesh files (default: a furnished house of 20 m, which is generated)."""
    color_s: float = opening.COLOR_S
    """Time to learn colours [s]."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for no time at all."""
        require_positive(color_s=self.color_s)


def run(request: OpeningRequest) -> JobEvents:
    """Yield which mesh is under way; return the times of each, by name.

    Raises NerfnavError for what is no mesh, before anything is measured, and for meshes that cannot be opened.
    """
    for file in request.files:
        if (kind := source_kind(file)) is not SourceKind.MESH:
            raise wrong_kind_error(file, kind, "a mesh")
    names = [file.name for file in request.files]
    if len(set(names)) < len(names):
        raise InvalidInputError("two of the files have the same name: time them one after the other")
    rows = {}
    for index, file in enumerate(request.files or (None,)):
        yield Progress(f"opening {'a house' if file is None else file.name}", index / max(1, len(names)))
        rows |= opening.measure(file, request.color_s)
    return JobResult({"open": rows, "bars_s": opening.BARS})

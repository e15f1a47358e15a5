"""Export: the trajectory of a stored plan or flight in another format."""

from dataclasses import dataclass, replace
from pathlib import Path

from nerfnav.core.errors import NerfnavError
from nerfnav.export import FORMATS, Recording
from nerfnav_app.jobs.events import FileMade, JobEvents, JobResult, Progress
from nerfnav_app.jobs.export.recording import read_run, with_field
from nerfnav_app.jobs.export.surface import build_surface
from nerfnav_app.places.place import open_place
from nerfnav_app.storage.output_files import prepare_file, write_bytes
from nerfnav_app.storage.run_metadata import RunMetadata
from nerfnav_app.storage.run_store import RunStore


@dataclass(frozen=True)
class ExportRequest:
    """What to export."""

    run: Path
    """Folder that `nerfnav plan --out` or `nerfnav fly` wrote, or the name of a stored run."""
    format: str
    """Name of the format."""
    out: Path
    """The file to write."""
    force: bool = False
    """Whether to write also what should not be flown."""
    datum: tuple[float, float, float] | None = None
    """Where on Earth the world's origin is: latitude, longitude [deg], height [m]."""


def run(request: ExportRequest) -> JobEvents:
    """Write the file and return what it holds. Raises NerfnavError where run, format or file are wrong."""
    form = FORMATS[request.format]
    folder = _folder(request.run)
    made = replace(read_run(folder), datum=request.datum)
    out = prepare_file(request.out)
    if form.moves_vehicle:
        yield Progress("opening the field, to judge what the vehicle is to fly", 0.1)
        made = made.with_field(with_field(folder, made))
    if form.shows_place and made.steps:
        yield Progress("shaping the surface of the place", 0.2)
        made = made.with_surface(_surface(folder))
    exported = form.exported(made, request.force)
    write_bytes(out, exported.content)
    summary = {
        "format": request.format,
        "rows": made.table.values.shape[0],
        "columns": list(made.table.columns),
        "outcome": made.outcome or None,
        **exported.info,
        "file": str(out),
        "file_bytes": out.stat().st_size,
    }
    return JobResult(summary, (out,))


def download(made: Recording, format: str, name: str, force: bool) -> JobEvents:
    """Make the file, which is told and not written. Raises as `run` does."""
    yield Progress("judging what the vehicle is to fly", 0.3)
    exported = FORMATS[format].exported(made, force)
    yield FileMade(name, exported.content)
    return JobResult(exported.info)


def _folder(run: Path) -> Path:
    """The folder that is meant: as it is written, else the stored run of that name."""
    stored = RunStore().folder / run.name
    return stored if not run.exists() and len(run.parts) == 1 and stored.is_dir() else run


def _surface(folder: Path) -> bytes | None:
    """What stands for the place of a flight; None where the place is gone, which the export's numbers tell."""
    try:
        return build_surface(open_place(RunMetadata.load(folder).source)) or None
    except NerfnavError:
        return None

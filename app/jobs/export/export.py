"""Export: the plan, the executed path or the estimate of a stored run in another format."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from nerfnav.core.errors import InvalidInputError, NerfnavError
from nerfnav.export import FORMATS, ExportFormat, ExportRefusedError, Recording, Subject
from nerfnav_app.jobs.events import FileMade, JobEvents, JobResult, Progress, TrajectoryRefused
from nerfnav_app.jobs.export.recording import field_of, holds_flight, read_run
from nerfnav_app.jobs.export.surface import build_surface
from nerfnav_app.places.place import open_place
from nerfnav_app.storage.kept_obstacles import open_as_kept
from nerfnav_app.storage.output_files import prepare_file, write_bytes
from nerfnav_app.storage.run_metadata import RunMetadata
from nerfnav_app.storage.run_store import RunStore


@dataclass(frozen=True)
class ExportRequest:
    """Request of an export: run, subject, format and file. The command line reads it as it is."""

    run: Positional[Path]
    """Folder that `nerfnav plan --out` or `nerfnav fly` wrote, or name of a flight in runs/."""
    format: str
    """Name of the format, one of those above."""
    out: Path
    """File to write."""
    of: Literal["plan", "executed", "estimate"] | None = None
    """Trajectory of a flight: its first plan, the executed path or the estimate (default: that of the format)."""
    smooth: bool = False
    """Let a vehicle fly an executed path or an estimate along a smooth curve near it, which is judged first."""
    force: bool = False
    """Write also what is not safe to fly, such as a plan beyond the robot's limits."""
    datum: Annotated[tuple[float, float, float] | None, arg(metavar="LAT LON HEIGHT")] = None
    """Latitude and longitude [deg] and height [m] of the origin, for formats in degrees."""


def run(request: ExportRequest) -> JobEvents:
    """Write the file and return what it holds. Raises NerfnavError where run, format or file are wrong."""
    form = FORMATS[request.format]
    folder = _folder(request.run)
    subject = form.choose_subject(holds_flight(folder), None if request.of is None else Subject(request.of))
    if request.smooth and (subject is Subject.PLAN or not form.moves_vehicle):
        raise InvalidInputError("--smooth is for an executed path or an estimate that a vehicle flies: leave it out")
    made = replace(read_run(folder, subject), datum=request.datum)
    out = prepare_file(request.out)
    if form.moves_vehicle:
        yield Progress("opening the field, to judge what the vehicle is to fly", 0.1)
        made = made.with_field(field_of(folder))
    if form.shows_place and made.steps:
        yield Progress("shaping the surface of the place", 0.2)
        made = made.with_surface(_surface(folder))
    try:
        exported = form.exported(made, request.force, request.smooth)
    except ExportRefusedError:
        raise
    except InvalidInputError as error:
        raise InvalidInputError(f"{folder} cannot be exported: {error}") from error
    write_bytes(out, exported.content)
    summary = {
        "format": request.format,
        "of": subject.value,
        "rows": made.table.values.shape[0],
        "columns": list(made.table.columns),
        "outcome": made.outcome or None,
        **exported.info,
        "file": str(out),
        "file_bytes": out.stat().st_size,
    }
    return JobResult(summary, (out,))


def download(made: Recording, form: ExportFormat, name: str, force: bool = False, smooth: bool = False) -> JobEvents:
    """Yield the file instead of writing it, or the refusal. Raises NerfnavError as `run` does for anything else."""
    yield Progress("judging what the vehicle is to fly", 0.3)
    try:
        exported = form.exported(made, force, smooth)
    except ExportRefusedError as error:
        yield TrajectoryRefused(error.refusal)
        return JobResult()
    yield FileMade(name, exported.content)
    return JobResult(exported.info)


def _folder(run: Path) -> Path:
    """Folder of the run: the path, else the stored run of that name."""
    stored = RunStore().folder / run.name
    return stored if not run.exists() and len(run.parts) == 1 and stored.is_dir() else run


def _surface(folder: Path) -> bytes | None:
    """Surface of the place of a flight, with its obstacles; None where the place is gone, as the export then says."""
    try:
        place = open_as_kept(open_place(RunMetadata.load(folder).source), folder)
        return build_surface(place) or None
    except NerfnavError:
        return None

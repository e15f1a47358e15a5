"""Export: the trajectory of a stored plan or flight in another format."""

from dataclasses import dataclass
from pathlib import Path

from app.jobs.events import JobEvents, JobResult, Progress
from app.jobs.surface import surface_of
from app.places.opening import open_place
from app.storage import step_log as log
from app.storage.output_files import prepare_file, write_bytes
from app.storage.run_metadata import RunMetadata
from app.storage.run_store import RunStore
from nerfnav import robots
from nerfnav.errors import InvalidInputError, NerfnavError
from nerfnav.export.formats import FORMATS
from nerfnav.export.recording import Recording
from nerfnav.export.tables import table_of_json

TRAJECTORY = "trajectory.json"
"""What the folder of a plan holds."""


@dataclass(frozen=True)
class ExportRequest:
    """What to export."""

    run: Path
    """Folder that `nerfnav plan --out` or `nerfnav fly` wrote, or the name of a stored run."""
    format: str
    """Name of the format."""
    out: Path
    """The file to write."""


def run(request: ExportRequest) -> JobEvents:
    """Write the file and return what it holds. Raises NerfnavError where run, format or file are wrong."""
    form = FORMATS[request.format]
    folder = _folder(request.run)
    made = read_run(folder)
    out = prepare_file(request.out)
    if form.shows_place and made.steps:
        yield Progress("shaping the surface of the place", 0.2)
        made = made.standing_in(_surface(folder))
    exported = form.make(made)
    write_bytes(out, exported.content)
    summary = {
        "format": request.format,
        "rows": made.table.values.shape[0],
        "columns": list(made.table.columns),
        **exported.info,
        "file": str(out),
        "file_bytes": out.stat().st_size,
    }
    return JobResult(summary, (out,))


def read_run(folder: Path) -> Recording:
    """The flight or plan in a folder; of a flight that was interrupted, what was flown."""
    if (folder / log.FILE).is_file():
        about = RunMetadata.load(folder)
        return Recording.of_flight(log.read_steps(folder), robots.load(about.robot), title_of(about))
    path = folder / TRAJECTORY
    try:
        table = table_of_json(path.read_text())
        robot = str(table.info.get("robot", ""))
        known = robot in robots.names()
        return Recording(table, extents=robots.load(robot).body.extents) if known else Recording(table)
    except (FileNotFoundError, NotADirectoryError) as error:
        raise InvalidInputError(
            f"{folder} is not the folder of a run (it has no {log.FILE} and no {TRAJECTORY}); "
            "make one with `nerfnav plan` or `nerfnav fly` and --out"
        ) from error
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidInputError(f"{path} cannot be read: {error}") from error


def title_of(about: RunMetadata) -> str:
    """A flight in a few words."""
    return f"{about.place}, {about.task}" if about.task else about.place


def _folder(run: Path) -> Path:
    """The folder that is meant: as it is written, else the stored run of that name."""
    stored = RunStore().folder / run.name
    return stored if not run.exists() and len(run.parts) == 1 and stored.is_dir() else run


def _surface(folder: Path) -> bytes | None:
    """What stands for the place of a flight; None where the place is gone, which the export's numbers tell."""
    try:
        return surface_of(open_place(RunMetadata.load(folder).source)) or None
    except NerfnavError:
        return None

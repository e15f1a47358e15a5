"""Export: the trajectory of a stored plan or flight in another format."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from app.events import JobEvents, JobFinished, JobStarted
from app.jobs.outputs import prepare_file, write_text
from app.registry import named
from nerfnav.errors import InvalidInputError
from nerfnav.export.tables import Table, csv_text, json_text, table_of_json

TRAJECTORY = "trajectory.json"
"""What every run folder holds, whether of a plan or of a flight."""
FORMATS: dict[str, Callable[[Table], str]] = {"csv": csv_text, "json": json_text}
"""Name to what makes a table into the text of a file."""


@dataclass(frozen=True)
class ExportRequest:
    """What to export."""

    run: Path
    """Folder that `nerfnav plan --out` or `nerfnav fly --out` wrote."""
    format: str
    """Name of the format."""
    out: Path
    """The file to write."""


def run(request: ExportRequest) -> JobEvents:
    """Write the file. Raises NerfnavError where the run, the format or the file is not what it should be."""
    text_of = named("format", request.format, FORMATS)
    table = read_run(request.run)
    out = prepare_file(request.out)
    yield JobStarted("export")
    write_text(out, text_of(table))
    summary = {
        "format": request.format,
        "rows": table.values.shape[0],
        "columns": list(table.columns),
        "file": str(out),
        "file_bytes": out.stat().st_size,
    }
    yield JobFinished("export", summary, (out,))


def read_run(folder: Path) -> Table:
    """The trajectory of a run folder."""
    path = folder / TRAJECTORY
    try:
        return table_of_json(path.read_text())
    except (FileNotFoundError, NotADirectoryError) as error:
        raise InvalidInputError(
            f"{folder} is not the folder of a run (it has no {TRAJECTORY}); "
            "make one with `nerfnav plan` or `nerfnav fly` and --out"
        ) from error
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidInputError(f"{path} cannot be read: {error}") from error

"""Recording of a stored plan or flight, read from its folder."""

from contextlib import suppress
from pathlib import Path

from nerfnav import robots
from nerfnav.core.errors import InvalidInputError, NerfnavError
from nerfnav.export import Recording, table_of_json
from nerfnav.field import StoredField, UnknownSpace
from nerfnav_app.places.derived import prepare_place
from nerfnav_app.places.place import open_place
from nerfnav_app.storage.run_metadata import RunMetadata
from nerfnav_app.storage.step_codec import FILE
from nerfnav_app.storage.step_log import read_steps

TRAJECTORY = "trajectory.json"
"""File in the folder of a plan."""


def read_run(folder: Path) -> Recording:
    """Read the flight or plan in a folder; of a flight that was interrupted, the steps so far."""
    if (folder / FILE).is_file():
        about = RunMetadata.load(folder)
        return Recording.of_flight(read_steps(folder), robots.load(about.robot), title_of(about))
    path = folder / TRAJECTORY
    try:
        table = table_of_json(path.read_text())
        name = str(table.info.get("robot_file") or table.info.get("robot", ""))
        robot = robots.load(name) if robots.is_known(name) else None
        return Recording(table) if robot is None else Recording(table, extents=robot.body.extents, robot=robot)
    except (FileNotFoundError, NotADirectoryError) as error:
        raise InvalidInputError(
            f"{folder} is not the folder of a run (it has no {FILE} and no {TRAJECTORY}); "
            "make one with `nerfnav plan` or `nerfnav fly` and --out"
        ) from error
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidInputError(f"{path} cannot be read: {error}") from error


def with_field(folder: Path, recording: Recording) -> StoredField | None:
    """The field that the run in a folder was planned in, as its planner saw it.

    None where its place is gone or is no field any more, or was never noted, as by earlier versions.
    """
    if recording.steps:
        about = RunMetadata.load(folder)
        source, unknown = about.source, about.unknown
    else:
        info = recording.table.info
        source, unknown = str(info.get("place") or ""), str(info.get("unknown", ""))
    if not source or unknown not in (known.value for known in UnknownSpace):
        return None
    with suppress(NerfnavError):
        return prepare_place(open_place(source), UnknownSpace(unknown)).field
    return None


def title_of(about: RunMetadata) -> str:
    """Title of a flight: its place and its task."""
    return f"{about.place}, {about.task}" if about.task else about.place

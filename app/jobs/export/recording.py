"""Recording of a stored run, read from its folder: its plan, its executed path or its estimate."""

from contextlib import suppress
from pathlib import Path

from nerfnav import robots
from nerfnav.core.errors import InvalidInputError, NerfnavError
from nerfnav.export import Recording, Subject, table_of_json
from nerfnav.field import StoredField, UnknownSpace
from nerfnav.planner import PlanOutcome
from nerfnav_app.places.derived import prepare_place
from nerfnav_app.places.place import open_place
from nerfnav_app.storage.kept_obstacles import open_as_kept
from nerfnav_app.storage.run_metadata import RunMetadata
from nerfnav_app.storage.step_codec import FILE
from nerfnav_app.storage.step_log import read_steps

TRAJECTORY = "trajectory.json"
"""File in the folder of a plan."""


def holds_flight(folder: Path) -> bool:
    """Check whether a folder holds a flight; False for a plan. Raises InvalidInputError where it holds neither."""
    if (folder / FILE).is_file():
        return True
    if not (folder / TRAJECTORY).is_file():
        raise InvalidInputError(
            f"{folder} is not the folder of a run (it has no {FILE} and no {TRAJECTORY}); "
            "make one with `nerfnav plan` or `nerfnav fly` and --out"
        )
    return False


def read_run(folder: Path, subject: Subject = Subject.EXECUTED) -> Recording:
    """Read a subject of the flight in a folder, or the plan that it holds alone.

    Of a flight that was interrupted, the steps so far are read. Raises InvalidInputError where nothing can be read.
    """
    if holds_flight(folder):
        about = RunMetadata.load(folder)
        robot, title = robots.load(about.robot), title_of(about)
        recording = Recording.of_flight(read_steps(folder), robot, title, subject=subject)
        known = PlanOutcome.__members__.get((about.plan_outcome or "").upper())
        return recording.with_outcome(known) if subject is Subject.PLAN else recording
    path = folder / TRAJECTORY
    try:
        try:
            table = table_of_json(path.read_text())
        except InvalidInputError as error:
            raise InvalidInputError(f"{path} cannot be used: {error}") from error
        name = str(table.info.get("robot_file") or table.info.get("robot", ""))
        robot = robots.load(name) if robots.is_known(name) else None
        return Recording(table) if robot is None else Recording(table, extents=robot.body.extents, robot=robot)
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidInputError(f"{path} cannot be read: {error}") from error


def field_of(folder: Path) -> StoredField | None:
    """The field that the run in a folder was planned in, as its planner saw it, with the obstacles of the run.

    None where its place is gone or is no field any more, or was never noted, as by earlier versions.
    """
    if holds_flight(folder):
        about = RunMetadata.load(folder)
        source, unknown = about.source, about.unknown
    else:
        info = read_run(folder).table.info
        source, unknown = str(info.get("place") or ""), str(info.get("unknown", ""))
    if not source or unknown not in (known.value for known in UnknownSpace):
        return None
    with suppress(NerfnavError):
        return prepare_place(open_as_kept(open_place(source), folder), UnknownSpace(unknown)).field
    return None


def title_of(about: RunMetadata) -> str:
    """Title of a flight: its place and its task."""
    return f"{about.place}, {about.task}" if about.task else about.place

"""Export formats: name, ending, purpose and writer of each."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.registry import Registry
from nerfnav.export.ardupilot import ardupilot
from nerfnav.export.crazyflie import crazyflie
from nerfnav.export.curve_safety import judge_curve
from nerfnav.export.curves import quadrotor_of
from nerfnav.export.gltf import gltf
from nerfnav.export.px4 import px4, px4_odometry
from nerfnav.export.qgroundcontrol import qgroundcontrol
from nerfnav.export.recording import Exported, Recording
from nerfnav.export.replay import replay
from nerfnav.export.ros_bags import mcap, rosbag2
from nerfnav.export.tables import csv_text, json_text
from nerfnav.export.tum import tum, tum_estimate
from nerfnav.navigation import EpisodeOutcome
from nerfnav.planner import FLYABLE, PiecewisePolynomial, PlanOutcome

_HURT = (EpisodeOutcome.COLLIDED, EpisodeOutcome.DIVERGED)
"""Outcomes of flights that no vehicle should repeat."""


@dataclass(frozen=True)
class ExportFormat:
    """A format."""

    name: str
    """What users call it, as in `--format`."""
    ending: str
    """Of its files."""
    purpose: str
    """What it is for, in a few words."""
    make: Callable[[Recording], Exported]
    """Makes the content of a file."""
    flights_only: bool = False
    """Whether plans have nothing to put into it."""
    shows_place: bool = False
    """Whether the surface of the place goes into it."""
    moves_vehicle: bool = False
    """Whether a vehicle flies what it says."""
    needs_datum: bool = False
    """Whether it must know where on Earth the world is."""

    def exported(self, recording: Recording, force: bool = False) -> Exported:
        """The content of a file.

        What a vehicle is to follow is judged on the field that the recording knows. Raises InvalidInputError for what
        should not be flown, unless that is forced (`--force` on the command line), and where the format cannot take
        the recording.
        """
        why = explain_unsafe(_ending(recording), self)
        if why and not force:
            raise InvalidInputError(f"{why}; --force exports it all the same")
        exported = self.make(recording)
        return exported if exported.curve is None else _on_the_field(exported, exported.curve, recording, force)


def explain_unsafe(ended: PlanOutcome | EpisodeOutcome | None, form: ExportFormat) -> str:
    """Why what ended so should not be flown, in words; empty where nothing is known against it.

    A plan must have ended well whatever the format is; a flight is a record, and only what moves a vehicle repeats it.
    """
    if isinstance(ended, PlanOutcome) and ended not in FLYABLE:
        return f"this plan is not to be flown: {ended.value}"
    if form.moves_vehicle and ended in _HURT:
        return f"this flight is not to be flown again: {ended.value}"
    return ""


def _on_the_field(exported: Exported, curve: PiecewisePolynomial, recording: Recording, force: bool) -> Exported:
    """The file, with what the field says of its curve; nothing is said where no field is known."""
    if recording.field is None:
        return replace(exported, info=exported.info | {"curve": None})
    found = judge_curve(recording.field, curve, quadrotor_of(recording))
    if found.outcome not in FLYABLE and not force:
        raise InvalidInputError(
            f"the curve that the vehicle would fly is not to be flown, for it cuts the corners of what was planned: "
            f"{found.outcome.value}; plan with more room or time, or export it by force (--force)"
        )
    told = {
        "outcome": found.outcome.name.lower(),
        "collision_probability_bound": found.bound,
        "min_clearance_m": found.min_clearance_m,
    }
    return replace(exported, info=exported.info | {"curve": told})


def _ending(recording: Recording) -> PlanOutcome | EpisodeOutcome | None:
    outcomes = EpisodeOutcome if recording.steps else PlanOutcome
    return outcomes.__members__.get(recording.outcome.upper())


def _csv(made: Recording) -> Exported:
    return Exported(csv_text(made.table).encode())


def _json(made: Recording) -> Exported:
    return Exported(json_text(made.table).encode())


FORMATS: Registry[ExportFormat] = Registry("format", (
    ExportFormat("csv", "csv", "a table for spreadsheets", _csv),
    ExportFormat("json", "json", "the table with units and frames", _json),
    ExportFormat("tum", "tum", "the true path for trajectory evaluation", tum),
    ExportFormat("tum-estimate", "tum", "the estimated path for trajectory evaluation", tum_estimate, True),
    ExportFormat("px4", "csv", "setpoints in NED for PX4's offboard mode", px4, moves_vehicle=True),
    ExportFormat("px4-odometry", "csv", "the estimate as vision for PX4's estimator", px4_odometry, True),
    ExportFormat("ardupilot", "csv", "setpoints in NED for ArduPilot's guided mode", ardupilot, moves_vehicle=True),
    ExportFormat(
        "crazyflie", "csv", "polynomials for the Crazyflie's high-level commander", crazyflie, moves_vehicle=True
    ),
    ExportFormat(
        "qgroundcontrol", "plan", "waypoints in degrees for QGroundControl, given the origin's place on Earth",
        qgroundcontrol, moves_vehicle=True, needs_datum=True,
    ),
    ExportFormat("mcap", "mcap", "ROS 2 messages for Foxglove and ros2 bag", mcap),
    ExportFormat("rosbag2", "zip", "a ROS 2 bag, zipped", rosbag2),
    ExportFormat("gltf", "glb", "the path and the moving robot for Blender", gltf),
    ExportFormat("html", "html", "a replay that opens in any browser, without a server", replay, True, True),
))  # fmt: skip
"""Name to format."""


def register(form: ExportFormat) -> None:
    """Make a format known by its name. Raises NameTakenError where another one has it."""
    FORMATS.register(form)

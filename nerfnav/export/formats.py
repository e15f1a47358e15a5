"""Export formats: name, ending, purpose and writer of each."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.registry import Registry
from nerfnav.export.autopilots import ardupilot, px4, px4_odometry
from nerfnav.export.crazyflie import crazyflie
from nerfnav.export.curve_safety import judge_curve
from nerfnav.export.curves import quadrotor_of
from nerfnav.export.gltf import gltf
from nerfnav.export.qgroundcontrol import qgroundcontrol
from nerfnav.export.recording import Exported, Recording
from nerfnav.export.replay import replay
from nerfnav.export.ros_bags import mcap, rosbag2
from nerfnav.export.tables import csv_text, json_text
from nerfnav.export.tum import tum, tum_estimate
from nerfnav.navigation import EpisodeOutcome
from nerfnav.planner import FLYABLE, PiecewisePolynomial, PlanOutcome

_ENDED_BADLY = tuple(outcome for outcome in EpisodeOutcome if outcome.is_mishap)
"""Outcomes of flights that no vehicle should repeat."""


@dataclass(frozen=True)
class ExportFormat:
    """Export format: name, file ending, purpose and writer."""

    name: str
    """Name, as in `--format`."""
    ending: str
    """Of its files."""
    purpose: str
    """Purpose in a few words."""
    make: Callable[[Recording], Exported]
    """Makes the content of a file."""
    flights_only: bool = False
    """Exports flights only: plans lack its content."""
    shows_place: bool = False
    """Contains the surface of the place."""
    moves_vehicle: bool = False
    """Commands a vehicle."""
    needs_datum: bool = False
    """Needs the world's origin on Earth."""

    def exported(self, recording: Recording, force: bool = False) -> Exported:
        """Make the content of a file.

        Curves for vehicles are judged on the recording's field. Raises InvalidInputError for motions that should not
        be flown, unless that is forced (`--force` on the command line), and where the format cannot take the recording.
        """
        why = explain_unsafe(_ending(recording), self)
        if why and not force:
            raise InvalidInputError(f"{why}; --force exports it all the same")
        exported = self.make(recording)
        return exported if exported.curve is None else _on_the_field(exported, exported.curve, recording, force)


def explain_unsafe(ended: PlanOutcome | EpisodeOutcome | None, form: ExportFormat) -> str:
    """Explain why a motion with this outcome should not be flown; empty where it may be.

    A plan must have a good outcome for every format; a flight is a record, and only formats that command a vehicle
    repeat it.
    """
    if isinstance(ended, PlanOutcome) and ended not in FLYABLE:
        return f"this plan is not to be flown: {ended.value}"
    if form.moves_vehicle and ended in _ENDED_BADLY:
        return f"this flight is not to be flown again: {ended.value}"
    return ""


def _on_the_field(exported: Exported, curve: PiecewisePolynomial, recording: Recording, force: bool) -> Exported:
    """Add the safety of the file's curve in the field; None where no field is known."""
    if recording.field is None:
        return replace(exported, info=exported.info | {"curve": None})
    found = judge_curve(recording.field, curve, quadrotor_of(recording))
    if found.outcome not in FLYABLE and not force:
        raise InvalidInputError(
            f"the curve that the vehicle would fly is not to be flown, for it cuts the corners of what was planned: "
            f"{found.outcome.value}; plan with more room or time, or export it by force (--force)"
        )
    safety = {
        "outcome": found.outcome.name.lower(),
        "collision_probability_bound": found.bound,
        "min_clearance_m": found.min_clearance_m,
    }
    return replace(exported, info=exported.info | {"curve": safety})


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

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
from nerfnav.export.recording import Exported, Recording, Subject
from nerfnav.export.refusal import ExportRefusedError, NoCurveError, Refusal, Remedy
from nerfnav.export.replay import replay
from nerfnav.export.ros_bags import mcap, rosbag2
from nerfnav.export.tables import csv_text, json_text
from nerfnav.export.tum import tum
from nerfnav.navigation import EpisodeOutcome
from nerfnav.planner import FLYABLE, PiecewisePolynomial, PlanOutcome

_ENDED_BADLY = tuple(outcome for outcome in EpisodeOutcome if outcome.is_mishap)
"""Outcomes of flights that no vehicle should repeat."""
_RECORDS = (Subject.EXECUTED, Subject.ESTIMATE, Subject.PLAN)
_VEHICLES = (Subject.PLAN, Subject.EXECUTED, Subject.ESTIMATE)


@dataclass(frozen=True)
class ExportFormat:
    """Export format: name, file ending, purpose, writer and subjects."""

    name: str
    """Name, as in `--format`."""
    ending: str
    """Of its files."""
    purpose: str
    """Purpose in a few words."""
    make: Callable[[Recording], Exported]
    """Makes the content of a file."""
    subjects: tuple[Subject, ...] = _RECORDS
    """Subjects that a file can hold, the default one first."""
    shows_place: bool = False
    """Contains the surface of the place."""
    moves_vehicle: bool = False
    """Commands a vehicle."""
    needs_datum: bool = False
    """Needs the world's origin on Earth."""

    @property
    def flights_only(self) -> bool:
        """True where a plan lacks its content."""
        return Subject.PLAN not in self.subjects

    def choose_subject(self, flown: bool, of: Subject | None = None) -> Subject:
        """Choose the subject of an export: the one that is asked for, else the default of the format.

        Raises InvalidInputError where the format cannot hold it, or where a plan, not `flown`, has none.
        """
        if not flown and of not in (None, Subject.PLAN):
            raise InvalidInputError(
                f"this plan was not flown, so {of.title} does not exist: fly it (nerfnav fly), or export --of plan"
            )
        if not flown and self.flights_only:
            raise InvalidInputError(
                f"{self.name} needs {self.subjects[0].title}, and a plan has none: fly it (nerfnav fly) first"
            )
        if of is not None and of not in self.subjects:
            raise InvalidInputError(f"{self.name} holds {self.subjects[0].title} alone: leave out --of")
        return of or (self.subjects[0] if flown else Subject.PLAN)

    def exported(self, recording: Recording, force: bool = False, smooth: bool = False) -> Exported:
        """Make the content of a file.

        A vehicle gets a curve that is judged on the recording's field; of an executed path or an estimate only with
        `smooth`. Raises ExportRefusedError for motions that should not be flown, unless that is forced (`--force` on
        the command line), and InvalidInputError where the format cannot take the recording.
        """
        subject = self.choose_subject(recording.subject is not Subject.PLAN, recording.subject)
        if self.moves_vehicle:
            quadrotor_of(recording)
        refusal = explain_unsafe(_ending(recording), self, subject)
        if refusal is not None and not force:
            raise ExportRefusedError(refusal)
        if self.moves_vehicle and subject is not Subject.PLAN and not smooth:
            why = "it has the jumps of noise"
            raise ExportRefusedError(Refusal(subject, self.name, why, (Remedy.PLAN, Remedy.SMOOTH)))
        try:
            exported = self.make(recording)
        except NoCurveError as error:
            if subject is Subject.PLAN:
                raise
            raise ExportRefusedError(Refusal(subject, self.name, str(error), (Remedy.PLAN,))) from error
        return exported if exported.curve is None else self._judge(exported, exported.curve, recording, force)

    def _judge(self, exported: Exported, curve: PiecewisePolynomial, recording: Recording, force: bool) -> Exported:
        """Add the safety of the file's curve in the field; None where no field is known."""
        if recording.field is None:
            return replace(exported, info=exported.info | {"curve": None})
        found = judge_curve(recording.field, curve, quadrotor_of(recording))
        if found.outcome not in FLYABLE and not force:
            why = f"its smooth curve cuts the corners of the rows: {found.outcome.value}"
            raise ExportRefusedError(Refusal(recording.subject, self.name, why, _remedies(recording.subject)))
        safety = {
            "outcome": found.outcome.name.lower(),
            "collision_probability_bound": found.bound,
            "min_clearance_m": found.min_clearance_m,
        }
        return replace(exported, info=exported.info | {"curve": safety})


def explain_unsafe(ended: PlanOutcome | EpisodeOutcome | None, form: ExportFormat, subject: Subject) -> Refusal | None:
    """Explain why a motion with this outcome should not be flown; None where it may be.

    A plan must have a good outcome for every format; an executed path and an estimate are records, and only formats
    that command a vehicle repeat them.
    """
    bad_plan = isinstance(ended, PlanOutcome) and ended not in FLYABLE
    if ended is not None and (bad_plan or (form.moves_vehicle and ended in _ENDED_BADLY)):
        return Refusal(subject, form.name, ended.value, _remedies(subject))
    return None


def _remedies(subject: Subject) -> tuple[Remedy, ...]:
    return (Remedy.REPLAN if subject is Subject.PLAN else Remedy.PLAN), Remedy.FORCE


def _ending(recording: Recording) -> PlanOutcome | EpisodeOutcome | None:
    outcomes = PlanOutcome if recording.subject is Subject.PLAN else EpisodeOutcome
    return outcomes.__members__.get(recording.outcome.upper())


def _csv(made: Recording) -> Exported:
    return Exported(csv_text(made.table).encode())


def _json(made: Recording) -> Exported:
    return Exported(json_text(made.table).encode())


FORMATS: Registry[ExportFormat] = Registry("format", (
    ExportFormat("csv", "csv", "a table for spreadsheets", _csv),
    ExportFormat("json", "json", "the table with units and frames", _json),
    ExportFormat("tum", "tum", "the path for trajectory evaluation", tum),
    ExportFormat("tum-estimate", "tum", "the estimated path for trajectory evaluation", tum, (Subject.ESTIMATE,)),
    ExportFormat("px4", "csv", "setpoints in NED for PX4's offboard mode", px4, _VEHICLES, moves_vehicle=True),
    ExportFormat(
        "px4-odometry", "csv", "the estimate as vision for PX4's estimator", px4_odometry, (Subject.ESTIMATE,)
    ),
    ExportFormat(
        "ardupilot", "csv", "setpoints in NED for ArduPilot's guided mode", ardupilot, _VEHICLES, moves_vehicle=True
    ),
    ExportFormat(
        "crazyflie", "csv", "polynomials for the Crazyflie's high-level commander", crazyflie, _VEHICLES,
        moves_vehicle=True,
    ),
    ExportFormat(
        "qgroundcontrol", "plan", "waypoints in degrees for QGroundControl, given the origin's place on Earth",
        qgroundcontrol, _VEHICLES, moves_vehicle=True, needs_datum=True,
    ),
    ExportFormat("mcap", "mcap", "ROS 2 messages for Foxglove and ros2 bag", mcap),
    ExportFormat("rosbag2", "zip", "a ROS 2 bag, zipped", rosbag2),
    ExportFormat("gltf", "glb", "the path and the moving robot for Blender", gltf),
    ExportFormat(
        "html", "html", "a replay that opens in any browser, without a server", replay, (Subject.EXECUTED,),
        shows_place=True,
    ),
))  # fmt: skip
"""Name to format."""


def register(form: ExportFormat) -> None:
    """Make a format known by its name. Raises NameTakenError where another one has it."""
    FORMATS.register(form)

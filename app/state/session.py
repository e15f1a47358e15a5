"""Session: the app's whole state as one frozen value.

It says what is wanted of the worker (`job`, and `app.queries`) and all that the page shows. No other place holds
state: a reloaded page and a second tab show the same. `app.reducers.root` moves it from one action to the next. A
notice tells the user something once, in passing.
"""


from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

from torch import Tensor

from nerfnav.robots import RobotFile
from nerfnav_app.jobs.events import PlannerResult
from nerfnav_app.places.ends import End, EndRole, Ends, default_ends
from nerfnav_app.places.place import Place
from nerfnav_app.places.sources import USUAL, QualityName
from nerfnav_app.places.vantage import View
from nerfnav_app.state.alignment import AlignmentDraft
from nerfnav_app.state.experiments import ExperimentState
from nerfnav_app.state.history import History, Moment, SavedSession
from nerfnav_app.state.job import Download, Job, JobKind
from nerfnav_app.state.records import FlightRecord, LocalizationRecord, PlanRecord
from nerfnav_app.state.runs import Runs, TimedRecord
from nerfnav_app.state.settings import Choice, FlightSettings, PlanSettings
from nerfnav_app.state.tracks import TrackRecord
from nerfnav_app.state.view import Eye, ViewSettings


@dataclass(frozen=True)
class Notice:
    """Something that the user should know now."""

    id: int
    """Rises by one from notice to notice."""
    title: str
    body: str
    bad: bool = False
    """Whether something failed."""
    cause: Hashable = None
    """What a person had asked for by then, `Session.asked`: once that is something else, it is old news."""


Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Click:
    """A click into the scene that puts an end down."""

    which: EndRole
    """The end that is put there."""
    origin: Vector
    """Where the ray of the click begins [m]."""
    direction: Vector
    """Where it goes, of any length."""


@dataclass(frozen=True)
class Session:
    """Everything the app knows."""

    what: str
    """Scene name or field file that is opened."""
    choice: Choice = field(default_factory=Choice)
    """Which robot, planner and estimator."""
    plan_settings: PlanSettings = field(default_factory=PlanSettings)
    """How plans are made."""
    flight_settings: FlightSettings = field(default_factory=FlightSettings)
    """How flights are flown."""
    robot_draft: RobotFile | None = None
    """Changes of the robot that are not taken yet."""
    place: Place | None = None
    """None while it is being opened."""
    places_asked: int = 0
    """Rises when the library of places may have changed."""
    quality: QualityName = USUAL
    """How well places are learned that come without a field."""
    surface: bytes | None = None
    """The field's surface as binary glTF; None while it is being shaped."""
    surface_is_rough: bool = False
    """Whether a texture is still to be made for it."""
    task: str | None = None
    """The task whose ends these are; None when they were moved by hand."""
    home: str | None = None
    """The task that was chosen last, to which a reset returns."""
    home_ends: Ends | None = None
    """The ends that were found for the robot where no task is home."""
    ends: Ends = field(default_factory=Ends)
    """Start and goal."""
    view: View | None = None
    """From where both ends are seen; None where nobody has looked for that: then all of the place is looked at."""
    seeking: bool = False
    """Whether ends are being looked for that suit the robot: those of now do not."""
    problems: dict[EndRole, str | None] = field(default_factory=dict)
    """What keeps the robot from an end, None where nothing does; absent while it is being looked at."""
    offers: dict[EndRole, End] = field(default_factory=dict)
    """Where the robot would fit near an end at which it does not."""
    outside: Mapping[EndRole, End] = field(default_factory=dict)
    """Ends that were typed where the robot cannot be: they are shown until they are put right, and not taken."""
    held: bool = False
    """Whether a hand moves an end now."""
    history: History = field(default_factory=History)
    """Moves and settings that can be undone."""
    aiming: EndRole | None = None
    """Which end the next click into the scene puts down."""
    clicked: Click | None = None
    """A click whose landing is being looked for."""
    placing: AlignmentDraft = field(default_factory=AlignmentDraft)
    """What up, scale and box are to be put right by."""
    view_settings: ViewSettings = field(default_factory=ViewSettings)
    """What the page draws of the place."""
    eyes: Mapping[int, Eye] = field(default_factory=dict)
    """From where each tab looks, where that matters."""
    results: Mapping[Hashable, tuple[Any, Any]] = field(default_factory=dict)
    """Queries of the place and their results, by slot: see nerfnav_app.queries.query."""
    job: Job | None = None
    """What the worker is to do."""
    jobs_begun: int = 0
    """How many jobs there were."""
    plan: PlanRecord | None = None
    """The last plan."""
    doubt: PlanRecord | None = None
    """A plan that is not safe, which a person has asked to fly: whether it is flown anyway is not said yet."""
    comparison: tuple[PlannerResult, ...] = ()
    """What the planners of the last comparison have found, as far as it has come."""
    flight: FlightRecord | None = None
    """The last flight."""
    track: TrackRecord | None = None
    """A camera that is followed, or was, in place of a flight: there is at most one of both."""
    search: LocalizationRecord | None = None
    """What the last search for the robot has found, as far as it has come."""
    runs: Runs = field(default_factory=Runs)
    """Stored flights, and the timeline."""
    experiments: ExperimentState = field(default_factory=ExperimentState)
    """Experiments and their results."""
    download: Download | None = None
    """The file that was made last."""
    notices: tuple[Notice, ...] = ()
    """The last few, newest last."""
    viewed: View | None = None
    """From where somebody has looked last; None where nobody has turned the camera."""
    left_off: SavedSession | None = None
    """How a server last left this place, until it is open again."""
    before: "Session | None" = None
    """Where to go back to if the place cannot be opened; None for the first place."""

    @classmethod
    def opening(
        cls, what: str, choice: Choice | None = None, surface: bytes | None = None, left_off: SavedSession | None = None
    ) -> "Session":
        """The session at the start: `what` is to be opened; `surface` and `left_off` may be known from earlier."""
        job = Job(0, JobKind.OPEN, label="Opening the field")
        return cls(what, choice or Choice(), job=job, jobs_begun=1, surface=surface, left_off=left_off)

    @property
    def first_ends(self) -> Ends | None:
        """Where a reset puts the ends: those of the task that was chosen last, or those that were found."""
        if self.place is None or self.home is None:
            return self.home_ends
        return default_ends(self.place, self.home)

    @property
    def moment(self) -> Moment:
        """What is asked for now."""
        return Moment(**{part.name: getattr(self, part.name) for part in fields(Moment)})

    @property
    def fresh_plan(self) -> PlanRecord | None:
        """The plan, if it is finished and safe, and what is asked for now."""
        plan = self.plan
        return plan if plan is not None and plan.is_good and not self.plan_is_stale else None

    @property
    def unsafe_plan(self) -> PlanRecord | None:
        """The plan, if it is what is asked for now and not to be flown."""
        plan = self.plan
        return plan if plan is not None and plan.is_unsafe and not self.plan_is_stale else None

    @property
    def asked(self) -> Hashable:
        """What a person has asked for: whatever goes wrong is caused by that."""
        opening = self.job is not None and self.job.kind is JobKind.OPEN and self.place is not None
        job = None if self.job is None or opening else self.job.id
        settings = self.choice, self.ends, self.plan_settings, self.flight_settings
        return self.what, settings, self.placing, self.aiming, self.runs.asked, self.experiments, self.jobs_begun, job

    @property
    def trouble(self) -> Notice | None:
        """What failed last, until something else is asked for."""
        last = next((notice for notice in reversed(self.notices) if notice.bad), None)
        return last if last is not None and last.cause == self.asked else None

    @property
    def plan_is_stale(self) -> bool:
        """Whether something else is asked for than when the plan was made: other ends, settings or planner."""
        plan = self.plan
        asked = self.ends, self.choice.planner, self.plan_settings
        return plan is not None and (plan.ends, plan.planner, plan.settings) != asked

    @property
    def plan_follows_hand(self) -> bool:
        """Whether the plan is a moment behind a hand that moves an end."""
        return self.held and self.plan is not None and self.plan.draft and not self.plan.refusal

    @property
    def flight_is_shown(self) -> bool:
        """Whether there is a flight in place of the plan, be it under way: until start or goal move after it."""
        return self.flight is not None and bool(self.flight.steps) and (self.in_flight or not self.flight_is_stale)

    @property
    def replaying(self) -> bool:
        """Whether a plan is being shown again, at a pace that a person can follow."""
        return self.plan is not None and self.plan.replayed is not None

    @property
    def may_begin(self) -> bool:
        """Whether a job may begin: the place is there, and nothing runs but what only makes later jobs quicker."""
        waits = self.job is None or (self.job.kind is JobKind.OPEN and self.surface is not None)
        return self.place is not None and waits

    @property
    def in_flight(self) -> bool:
        """Whether a flight is under way, be it held."""
        return self.job is not None and self.job.kind is JobKind.FLY

    @property
    def moves(self) -> bool:
        """Whether something changes with time alone."""
        return self.replaying or self.runs.timeline.playing

    @property
    def flight_is_stale(self) -> bool:
        """Whether start or goal have moved since the flight began."""
        return self.flight is not None and self.flight.ends != self.ends

    @property
    def shown_flight(self) -> FlightRecord | None:
        """The flight, as much of it as the timeline shows."""
        return self.runs.shown(self.flight)

    @property
    def shown_track(self) -> TrackRecord | None:
        """The track, as much of it as the timeline shows."""
        return self.runs.shown(self.track)

    @property
    def timed(self) -> TimedRecord | None:
        """What the timeline goes along."""
        return self.track if self.flight is None else self.flight

    @property
    def growing(self) -> bool:
        """Whether that is still under way: then its last moment is shown."""
        return self.in_flight or (self.job is not None and self.job.kind is JobKind.TRACK)

    @property
    def last_picture(self) -> Tensor | None:
        """What the robot's camera saw last, as far as the timeline shows its flight; None without a picture."""
        steps = () if self.shown_flight is None else self.shown_flight.steps
        return next((step.image for step in reversed(steps) if step.image is not None), None)

    @property
    def may_find(self) -> bool:
        """Whether the robot can be looked for: there is a picture, and nothing but a flight in the way."""
        return self.last_picture is not None and (self.job is None or self.in_flight)

    @property
    def run_list_stamp(self) -> tuple[int, ...]:
        """Changes whenever the list of stored runs may have changed."""
        return self.jobs_begun, int(self.job is not None), self.runs.asked

    def close_tab(self, client: int) -> "Session":
        """After a tab was closed: what was rendered for it alone is forgotten."""
        eyes = {tab: eye for tab, eye in self.eyes.items() if tab != client}
        kept = {slot: pair for slot, pair in self.results.items() if getattr(pair[0], "client", None) != client}
        return replace(self, eyes=eyes, results=kept, held=False)  # perhaps by its hand

    @property
    def steps_reported(self) -> int:
        """Time steps of the flight so far, the start included."""
        return len(self.flight.steps) if self.flight is not None else 0

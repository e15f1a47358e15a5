"""Session: the app's whole state as one frozen value, composed of the states of place, plan, flight and view.

It says what is wanted of the worker (`job`, and `nerfnav_app.queries`) and all that the page shows. No other place
holds state: a reloaded page and a second tab show the same. `nerfnav_app.reducers.root` moves it from one action to
the next. Its undo history holds moments: the settings before each move and each change of a setting. `SavedSession` is
such a moment on disk: the next server that opens the place restores it.
"""

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

from torch import Tensor

from nerfnav.export import Refusal
from nerfnav.importers import Corners
from nerfnav.obstacles import ObstacleSet
from nerfnav_app.places.ends import Ends
from nerfnav_app.places.vantage import View
from nerfnav_app.state.flight import FlightRecord, FlightSettings, FlightState
from nerfnav_app.state.job import Download, Job, JobKind, RefusedExport
from nerfnav_app.state.obstacles import ObstacleState, PathPoint, PlacedObstacle
from nerfnav_app.state.place import Choice, OpenPlace, PlaceState
from nerfnav_app.state.plan import PlanRecord, PlanSettings, PlanState
from nerfnav_app.state.runs import ExperimentState, Runs, TimedRecord
from nerfnav_app.state.tracks import TrackRecord
from nerfnav_app.state.view import ViewSettings, ViewState
from nerfnav_app.storage.run_metadata import StoredRun

MOST_UNDO_STEPS = 100
"""Length of the undo history."""


@dataclass(frozen=True)
class Moment:
    """Settings of a session at one time, as far as they can be undone; the names are those of the stored file."""

    choice: Choice
    task: str | None
    home: str | None
    """The task that was chosen last."""
    home_ends: Ends | None
    """The ends that were proposed for the robot, without a chosen task."""
    ends: Ends
    plan_settings: PlanSettings
    flight_settings: FlightSettings
    view_settings: ViewSettings
    obstacles: tuple[PlacedObstacle, ...] = ()


@dataclass(frozen=True)
class HistoryStep:
    """A moment to return to, with its plan."""

    moment: Moment
    """Settings of that time."""
    plan: PlanRecord | None = None
    """Plan of that time; None without one, and while one was computed."""


@dataclass(frozen=True)
class History:
    """Steps to go back to and forward to, the nearest last."""

    past: tuple[HistoryStep, ...] = ()
    future: tuple[HistoryStep, ...] = ()
    last: Hashable = None
    """What the last step has changed: a hand that moves on makes no further step."""
    travels: int = 0
    """Number of undos and redos so far."""

    def stepped(self, before: HistoryStep, what: Hashable) -> "History":
        """Add a step: `what` has changed since `before`."""
        if what is not None and what == self.last and self.past:
            return replace(self, future=())
        return History((*self.past, before)[-MOST_UNDO_STEPS:], (), what, self.travels)


@dataclass(frozen=True)
class SavedSession:
    """Moment and camera of a place, as they are stored on disk."""

    moment: Moment
    """The settings."""
    view: View | None = None
    """Camera pose that a user chose last; None until the camera was turned."""


@dataclass(frozen=True)
class Notice:
    """A message to the user."""

    id: int
    """Rises by one from notice to notice."""
    title: str
    body: str
    bad: bool = False
    """True where something failed."""
    cause: Hashable = None
    """`Session.asked` at that time: once that has changed, the notice is out of date."""
    remedy: OpenPlace | None = None
    """Command that leaves out the stray parts for which a mesh was not opened."""


@dataclass(frozen=True)
class Session(PlaceState, ObstacleState, PlanState, FlightState, ViewState):
    """Everything the app knows."""

    what: str
    """Scene name or field file that is opened."""
    box: Corners | None = None
    """Box of the field that is made of what is opened; None: all of it."""
    job: Job | None = None
    """Work that is wanted of the worker."""
    jobs_begun: int = 0
    """Number of jobs so far."""
    results: Mapping[Hashable, tuple[Any, Any]] = field(default_factory=dict)
    """Queries of the place and their results, by slot: see nerfnav_app.queries.query."""
    runs: Runs = field(default_factory=Runs)
    """Stored flights, and the timeline."""
    experiments: ExperimentState = field(default_factory=ExperimentState)
    """Experiments and their results."""
    download: Download | None = None
    """The file that was made last."""
    refused_export: RefusedExport | None = None
    """The trajectory that was refused last, as a file for a vehicle."""
    notices: tuple[Notice, ...] = ()
    """The last few, newest last."""
    history: History = field(default_factory=History)
    """Moves and settings that can be undone."""
    saved: SavedSession | None = None
    """Settings of the last server in this place, until it is open again."""
    before: "Session | None" = None
    """Session to return to if the place cannot be opened; None for the first place."""

    @classmethod
    def opening(
        cls, what: str, choice: Choice | None = None, surface: bytes | None = None, saved: SavedSession | None = None
    ) -> "Session":
        """Begin a session that opens `what`; `surface` and `saved` may be known from earlier."""
        job = Job(0, JobKind.OPEN, label="Opening the field")
        return cls(what, choice=choice or Choice(), job=job, jobs_begun=1, surface=surface, saved=saved)

    @property
    def moment(self) -> Moment:
        """The settings of now."""
        return Moment(**{part.name: getattr(self, part.name) for part in fields(Moment)})

    @property
    def history_step(self) -> HistoryStep:
        """The settings of now and the plan, unless one is being computed."""
        computed = self.job is not None and self.job.kind is JobKind.PLAN
        return HistoryStep(self.moment, None if self.plan is None or computed else self.plan.without_replay)

    @property
    def asked(self) -> Hashable:
        """The user's requests so far: the cause of whatever goes wrong."""
        opening = self.job is not None and self.job.kind is JobKind.OPEN and self.place is not None
        job = None if self.job is None or opening else self.job.id
        settings = self.choice, self.ends, self.plan_settings, self.flight_settings
        aims = self.alignment, self.aiming, self.obstacles
        return self.what, settings, aims, self.runs.asked, self.experiments, self.jobs_begun, job

    @property
    def trouble(self) -> Notice | None:
        """The last failure, until the user asks for something else."""
        last = next((notice for notice in reversed(self.notices) if notice.bad), None)
        return last if last is not None and last.cause == self.asked else None

    @property
    def export_refusal(self) -> Refusal | None:
        """The last refusal of an export, until the user asks for something else."""
        last = self.refused_export
        return last.refusal if last is not None and last.cause == self.asked else None

    @property
    def field_made_by(self) -> str:
        """Origin of the field (`FieldInfo.made_by`), which changes when a trained field replaces a draft."""
        return "" if self.place is None else self.place.field.info.made_by

    @property
    def placed_obstacles(self) -> ObstacleSet | None:
        """The obstacles in the place; None without any."""
        return None if self.place is None else self.place.obstacles

    @property
    def plan_is_stale(self) -> bool:
        """True where ends, planner, settings, noise, world or obstacles have changed since the plan was requested, or a
        draft was replaced."""
        plan = self.plan
        if plan is None:
            return False
        flight, now = plan.flight, self.flight_settings
        asked = self.ends, self.choice.planner, self.plan_settings, now.noise, now.world, self.placed_obstacles
        replaced = plan.field_made_by not in ("", self.field_made_by)
        made = plan.ends, plan.planner, plan.settings, flight.noise, flight.world, plan.obstacles
        return replaced or made != asked

    def new_plan(self, ends: Ends) -> PlanRecord:
        """Begin the record of a plan between `ends` with the settings of now."""
        return PlanRecord(
            ends, self.choice.planner, self.plan_settings, self.flight_settings, self.field_made_by,
            self.placed_obstacles,
        )  # fmt: skip

    @property
    def fresh_plan(self) -> PlanRecord | None:
        """The plan, if it is finished, safe and up to date."""
        return self.plan if self.plan is not None and self.plan.is_good and not self.plan_is_stale else None

    @property
    def unsafe_plan(self) -> PlanRecord | None:
        """The plan, if it is up to date and not to be flown."""
        return self.plan if self.plan is not None and self.plan.is_unsafe and not self.plan_is_stale else None

    @property
    def in_draft(self) -> bool:
        """True where the field of the place is a draft."""
        return self.place is not None and self.place.field.info.is_draft

    @property
    def doubtful_plan(self) -> PlanRecord | None:
        """The plan, if it is up to date, and the user has to confirm its flight: it is unsafe, its risk is high, or too
        little is seen along it in a draft, which will show more once it is trained."""
        fresh = self.fresh_plan
        doubtful = fresh is not None and (fresh.is_risky or (self.in_draft and fresh.is_mostly_blind))
        return fresh if doubtful else self.unsafe_plan

    @property
    def plan_follows_hand(self) -> bool:
        """True where the plan is a moment behind a hand that drags an end or an obstacle."""
        return self.held and self.plan is not None and self.plan.draft and not self.plan.refusal

    @property
    def may_begin(self) -> bool:
        """True where a job may begin: the place is open, and nothing runs but what only makes later jobs quicker."""
        waits = self.job is None or (self.job.kind is JobKind.OPEN and self.surface is not None)
        return self.place is not None and waits

    @property
    def in_flight(self) -> bool:
        """True while a flight is under way, held or not."""
        return self.job is not None and self.job.kind is JobKind.FLY

    @property
    def growing(self) -> bool:
        """True while a flight or a track is under way: then its last moment is shown."""
        return self.in_flight or (self.job is not None and self.job.kind is JobKind.TRACK)

    @property
    def moves(self) -> bool:
        """True while something changes with time alone."""
        return self.replaying or self.runs.timeline.playing or self.motion_time is not None

    @property
    def drawing(self) -> PlacedObstacle | None:
        """The obstacle whose path clicks into the scene draw."""
        return self.chosen_obstacle if self.aiming is PathPoint.NEXT else None

    @property
    def obstacle_time(self) -> float:
        """Time at which the page shows obstacles that move [s]: that of the shown flight, or while their motions are
        played; else that of take-off."""
        if self.motion_time is not None:
            return self.motion_time
        flight = self.shown_flight
        return flight.steps[-1].time if self.flight_is_shown and flight is not None and flight.steps else 0.0

    @property
    def flight_is_stale(self) -> bool:
        """True where start, goal or obstacles have moved since the flight."""
        flight = self.flight
        if flight is None:
            return False
        placed = flight.flown_by is not None and flight.obstacles != self.placed_obstacles
        return placed or flight.ends != self.ends

    @property
    def flown_by(self) -> Hashable:
        """All settings that a flight is flown by, but for its pace, which changes nothing of it."""
        return self.choice, self.plan_settings, replace(self.flight_settings, pace=FlightSettings.pace)

    @property
    def flight_outdated_by(self) -> str:
        """Name what was replaced since the flight began: a draft of the "field", or "settings"; else empty."""
        flight = self.flight
        if flight is None:
            return ""
        if flight.flown_in not in ("", self.field_made_by):
            return "field"
        return "" if flight.flown_by in (None, self.flown_by) else "settings"

    @property
    def flight_is_shown(self) -> bool:
        """True where a flight is shown in place of the plan: until start, goal or obstacles move after it."""
        return self.flight is not None and bool(self.flight.steps) and (self.in_flight or not self.flight_is_stale)

    @property
    def shown_flight(self) -> FlightRecord | None:
        """The flight up to the time that the timeline shows."""
        return self.runs.shown(self.flight)

    @property
    def shown_track(self) -> TrackRecord | None:
        """The track up to the time that the timeline shows."""
        return self.runs.shown(self.track)

    @property
    def timed(self) -> TimedRecord | None:
        """The record that the timeline goes along."""
        return self.track if self.flight is None else self.flight

    @property
    def last_picture(self) -> Tensor | None:
        """The robot's last camera picture at the time that the timeline shows; None without a picture."""
        steps = () if self.shown_flight is None else self.shown_flight.steps
        return next((step.image for step in reversed(steps) if step.image is not None), None)

    @property
    def may_find(self) -> bool:
        """True where the robot can be localized globally: there is a picture, and no job but a flight."""
        return self.last_picture is not None and (self.job is None or self.in_flight)

    @property
    def run_list_stamp(self) -> tuple[int, ...]:
        """Changes whenever the list of stored runs may have changed."""
        return self.jobs_begun, int(self.job is not None), self.runs.asked

    def is_place_of(self, run: StoredRun) -> bool:
        """Check whether a stored run was flown in the open place; one that was renamed is known by its source."""
        here = self.place is not None and run.metadata.place == self.place.name
        return here or run.metadata.source == self.what

    @property
    def compares_planners(self) -> bool:
        """True while planners are compared: their plans are shown in place of a flight."""
        return bool(self.comparison) or (self.job is not None and self.job.kind is JobKind.COMPARE)

    def close_tab(self, client: int) -> "Session":
        """Drop what was rendered for a tab that was closed."""
        eyes = {tab: eye for tab, eye in self.eyes.items() if tab != client}
        kept = {slot: pair for slot, pair in self.results.items() if getattr(pair[0], "client", None) != client}
        let_go = replace(self.alignment, held=False)
        # its hand may have held something, and the motions may have been played for it alone
        return replace(self, eyes=eyes, results=kept, held=False, alignment=let_go, motion_time=None)

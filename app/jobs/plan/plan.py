"""Plan: from a start and a goal to a trajectory through the field, judged on the mesh; and the request of one."""

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from nerfnav.core.errors import InvalidInputError, require_positive, require_probability
from nerfnav.field import UnknownSpace
from nerfnav.planner import (
    FLYABLE,
    FastPlanConfig,
    OccupancyMap,
    PlannerConfig,
    PlannerEntry,
    PlanOutcome,
    PlanProblem,
    PlanStep,
    Route,
    SearchConfig,
    Timing,
    enforce_chance_constraint,
    estimate_timing,
    find_shortest_plan,
    map_for,
    path_length,
    planners,
)
from nerfnav_app.jobs.events import JobEvents, JobResult, Progress
from nerfnav_app.jobs.plan.report import mesh_overlap_m3, save, summary_of
from nerfnav_app.places.derived import build_occupancy, prepare_place
from nerfnav_app.places.ends import Ends
from nerfnav_app.places.place import Place
from nerfnav_app.storage.output_files import prepare_folder


@dataclass(frozen=True)
class PlanRequest:
    """What to plan."""

    ends: Ends
    """Where the robot is, and where it shall come to rest."""
    steps: int = 20
    """Number of time steps."""
    dt: float = 0.1
    """Length of a step [s]."""
    planner: str = "fast"
    """Name of the planner."""
    config: PlannerConfig | None = None
    """Its settings; None: its own."""
    again: PlannerConfig | None = None
    """Its settings when the plan is redone at each step of a flight; None: the above with room for what pushes it."""
    keep_dt: bool = False
    """Whether steps have just this length where a duration is found, however many they are."""
    shortest: bool = False
    """Whether to find the shortest duration that keeps the robot's limits, in place of `steps`."""
    max_collision: float | None = None
    """Largest bound on the probability of a collision that is accepted; None accepts any."""
    unknown: UnknownSpace = UnknownSpace.OCCUPIED
    """What space that no camera ever saw into is taken for."""
    out: Path | None = None
    """Folder for trajectory.csv, trajectory.json and plan.json; None writes nothing."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for numbers that no plan can have."""
        require_positive(steps=self.steps, dt=self.dt, iterations=self.settings.iterations)
        require_probability(max_collision=self.max_collision)

    @property
    def settings(self) -> PlannerConfig:
        """How the planner works. Raises NerfnavError for an unknown planner, or settings of another one."""
        own = planners.load(self.planner).config()
        for given in (self.config, self.again):
            if given is not None and type(given) is not type(own):
                raise InvalidInputError(f"these settings are not those of the planner {self.planner!r}: leave them out")
        return own if self.config is None else self.config

    def lasting(self, seconds: float) -> "PlanRequest":
        """The same in a given time [s], cut into whole steps of about dt. Raises InvalidInputError for none."""
        require_positive(duration=seconds)
        steps = max(1, round(seconds / self.dt))
        return replace(self, steps=steps, dt=seconds / steps)


def run(request: PlanRequest, place: Place) -> JobEvents:
    """Yield every iteration of the planner; return the numbers of the last one and what was written.

    Raises NerfnavError where the request cannot be worked with.
    """
    entry, place = planners.load(request.planner), prepare_place(place, request.unknown)
    out = None if request.out is None else prepare_folder(request.out)
    yield Progress("finding a way", 0.0)
    last, worked_s = None, 0.0
    for step, seconds in _timed(_steps(request, place, entry)):
        last, worked_s = step, seconds
        yield step
        yield Progress("optimising", min(1.0, (step.iteration + 1) / request.settings.iterations))
    assert last is not None, "a planner yields at least one step"
    yield Progress("judging", 1.0)
    overlap = mesh_overlap_m3(place, last.motion)
    if overlap and last.outcome in FLYABLE:
        last = replace(last, outcome=PlanOutcome.TOUCHES_MESH)
        yield last
    summary = summary_of(last, place, worked_s, overlap, request.max_collision, request.settings.weights.risk)
    return JobResult(summary, () if out is None else save(out, last.motion, place, summary, request.unknown))


def timing_for(request: PlanRequest, place: Place, occupancy: OccupancyMap, keep_dt: bool = False) -> Timing:
    """How long the way that is asked for should take, before it is planned; in steps as long as asked with `keep_dt`.
    """
    problem = PlanProblem(place.field, place.robot, request.ends.start.state(), request.ends.goal.state())
    search = getattr(request.settings, "ways", SearchConfig.single())
    length = path_length(problem, map_for(problem, occupancy), search)
    return estimate_timing(place.robot, length, request.dt, request.dt if keep_dt or request.keep_dt else None)


def _steps(request: PlanRequest, place: Place, entry: PlannerEntry) -> Iterator[PlanStep]:
    """Plan as often as the request asks for: for the duration, then for the bound on collisions."""
    occupancy = build_occupancy(place, request.settings.occupancy, request.ends.start.position[2])
    occupancy = occupancy.remembering() if request.shortest else occupancy
    finder = entry.planner(place.field, place.robot, request.settings, occupancy=occupancy)
    start, goal, dt, last = request.ends.start.state(), request.ends.goal.state(), request.dt, None
    if request.shortest:
        timing = timing_for(request, place, occupancy)
        dt = timing.dt
        steps = find_shortest_plan(lambda count: finder.plan(Route(start, goal, count, dt)), place.robot, timing.config)
    else:
        steps = finder.plan(Route(start, goal, request.steps, dt))
    for last in steps:
        if last.outcome is None:
            yield last
    assert last is not None, "a planner yields at least one step"
    if request.max_collision is None:
        yield last
        return
    problem = PlanProblem(place.field, place.robot, start, goal, last.trajectory.steps, dt)
    careful = FastPlanConfig(weights=request.settings.weights, occupancy=request.settings.occupancy)
    yield from enforce_chance_constraint(problem, last, careful, request.max_collision, occupancy)


def _timed(steps: Iterator[PlanStep]) -> Iterator[tuple[PlanStep, float]]:
    """Each step with the time [s] in which it and those before were made, whatever the consumer did between them."""
    worked_s = 0.0
    while True:
        began = time.perf_counter()
        step = next(steps, None)
        worked_s += time.perf_counter() - began
        if step is None:
            return
        yield step, worked_s

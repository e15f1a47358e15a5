"""Plan: from a start and a goal to a trajectory through the field, judged on the mesh; and the request of one."""

import time
from dataclasses import dataclass, replace
from pathlib import Path

from nerfnav.core.errors import InvalidInputError, require_positive, require_probability
from nerfnav.field import UnknownSpace
from nerfnav.planner import (
    FLYABLE,
    FastPlanConfig,
    InteractivePlanner,
    OccupancyMap,
    Planner,
    PlannerConfig,
    PlannerEntry,
    PlanOutcome,
    PlanProblem,
    PlanSteps,
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
from nerfnav.robots import Motion
from nerfnav_app.jobs.events import JobEvents, JobResult, Progress
from nerfnav_app.jobs.plan.report import mesh_overlap_m3, save, summary_of
from nerfnav_app.places.derived import build_occupancy, prepare_place
from nerfnav_app.places.ends import Ends
from nerfnav_app.places.place import Place
from nerfnav_app.storage.output_files import prepare_folder


@dataclass(frozen=True)
class PlanRequest:
    """Request of a plan: start, goal, time steps and planner."""

    ends: Ends
    """Start and goal; the robot comes to rest at the goal."""
    steps: int = 20
    """Number of time steps."""
    dt: float = 0.1
    """Length of a step [s]."""
    planner: str = "fast"
    """Name of the planner."""
    config: PlannerConfig | None = None
    """Its settings; None: its own."""
    again: PlannerConfig | None = None
    """Its settings when it replans in flight; None: the above with room for disturbances."""
    keep_dt: bool = False
    """Keep this length of steps where a duration is found, however many they are."""
    shortest: bool = False
    """Find the shortest duration that keeps the robot's limits, in place of `steps`."""
    max_collision: float | None = None
    """Largest bound on the probability of a collision that is accepted; None accepts any."""
    unknown: UnknownSpace = UnknownSpace.OCCUPIED
    """State of space that no camera saw into, for planners."""
    draft: bool = False
    """Whether to plan as quickly as possible, without the verdict and the numbers of the job."""
    warm_start: Motion | None = None
    """Last plan, with which a draft begins, and from which it takes its speed where a duration is to be found."""
    out: Path | None = None
    """Folder for trajectory.csv, trajectory.json and plan.json; None writes nothing."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for numbers that no plan can have."""
        require_positive(steps=self.steps, dt=self.dt, iterations=self.settings.iterations)
        require_probability(max_collision=self.max_collision)

    @property
    def settings(self) -> PlannerConfig:
        """Settings of the planner. Raises NerfnavError for an unknown planner, or settings of another one."""
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
    steps, planned, worked_s = _optimise(request, place, entry), None, 0.0
    while planned is None:
        began = time.perf_counter()
        try:
            step = next(steps)
        except StopIteration as end:
            step = planned = end.value
        worked_s += time.perf_counter() - began
        yield step
        yield Progress("optimising", min(1.0, (step.iteration + 1) / request.settings.iterations))
    if request.draft:
        return JobResult()
    yield Progress("judging", 1.0)
    overlap = mesh_overlap_m3(place, planned.motion)
    if overlap and planned.outcome in FLYABLE:
        planned = replace(planned, outcome=PlanOutcome.TOUCHES_MESH)
        yield planned
    summary = summary_of(planned, place, worked_s, overlap, request.max_collision, request.settings.weights.risk)
    return JobResult(summary, () if out is None else save(out, planned.motion, place, summary, request.unknown))


def timing_for(request: PlanRequest, place: Place, occupancy: OccupancyMap, keep_dt: bool = False) -> Timing:
    """Estimate the time that a path takes, before it is planned; with `keep_dt`, in steps of the requested length."""
    problem = PlanProblem(place.field, place.robot, request.ends.start.state(), request.ends.goal.state())
    search = getattr(request.settings, "ways", SearchConfig.single())
    length = path_length(problem, map_for(problem, occupancy), search)
    return estimate_timing(place.robot, length, request.dt, request.dt if keep_dt or request.keep_dt else None)


def _optimise(request: PlanRequest, place: Place, entry: PlannerEntry) -> PlanSteps:
    """Plan as often as the request needs: for the duration, then for the bound on collisions."""
    occupancy = build_occupancy(place, request.settings.occupancy, request.ends.start.position[2])
    occupancy = occupancy.remembering() if request.shortest and not request.draft else occupancy
    finder = entry.planner(place.field, place.robot, request.settings, occupancy=occupancy)
    if request.draft:
        return (yield from _draft(request, finder))
    start, goal, dt = request.ends.start.state(), request.ends.goal.state(), request.dt
    if request.shortest:
        timing = timing_for(request, place, occupancy)
        dt = timing.dt
        steps = find_shortest_plan(lambda count: finder.plan(Route(start, goal, count, dt)), place.robot, timing.config)
    else:
        steps = finder.plan(Route(start, goal, request.steps, dt))
    planned = yield from steps
    if request.max_collision is None:
        return planned
    problem = PlanProblem(place.field, place.robot, start, goal, planned.trajectory.steps, dt)
    careful = FastPlanConfig(weights=request.settings.weights, occupancy=request.settings.occupancy)
    return (yield from enforce_chance_constraint(problem, planned, careful, request.max_collision, occupancy))


def _draft(request: PlanRequest, planner: Planner) -> PlanSteps:
    """Plan once, from the warm start where there is one and the planner can use it."""
    last, steps, dt = request.warm_start, request.steps, request.dt
    start, goal = request.ends.start.state(), request.ends.goal.state()
    if last is None:
        return planner.plan(Route(start, goal, steps, dt))
    if request.shortest:
        steps, dt = len(last.actions), last.dt * _stretch(last, request.ends)
    route = Route(start, goal, steps, dt)
    interactive = isinstance(planner, InteractivePlanner)
    return planner.replan_moved_ends(last, route) if interactive else planner.plan(route)


def _stretch(last: Motion, ends: Ends) -> float:
    """Ratio of the distance between the ends now and in the last plan, within a factor of two."""
    before = (last.states.position[-1] - last.states.position[0]).norm().item()
    now = (ends.goal.state().position - ends.start.state().position).norm().item()
    return min(max(now / max(before, 1e-3), 0.5), 2.0)

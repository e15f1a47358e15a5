"""Plan: from a start and a goal to a trajectory through the field, judged on the mesh."""

from collections.abc import Iterator
from dataclasses import replace

from app.jobs.events import JobEvents, JobResult, Progress
from app.jobs.plan_report import mesh_overlap_m3, save, summary_of
from app.jobs.plan_request import PlanRequest
from app.jobs.stopwatch import Stopwatch
from app.places.derived import occupancy_of, planning_place
from app.places.place import Place
from app.storage.output_files import prepare_folder
from nerfnav.planner import (
    GOOD,
    FastPlanConfig,
    OccupancyMap,
    Planner,
    PlanOutcome,
    PlanProblem,
    PlanStep,
    Route,
    planners,
)
from nerfnav.planner.astar import SearchConfig
from nerfnav.planner.chance import within_chance
from nerfnav.planner.duration import Timing, shortest_plan, timing_of
from nerfnav.planner.problem import map_for, way_length


def run(request: PlanRequest, place: Place) -> JobEvents:
    """Yield every iteration of the planner; return the numbers of the last one and what was written.

    Raises NerfnavError where the request cannot be worked with.
    """
    entry, place = planners.load(request.planner), planning_place(place, request.unknown)
    out = None if request.out is None else prepare_folder(request.out)
    yield Progress("finding a way", 0.0)
    clock, last = Stopwatch(), None
    with clock.running():
        occupancy = occupancy_of(place, request.settings.occupancy, request.ends.start.position[2])
        occupancy = occupancy.remembering() if request.shortest else occupancy
    finder = entry.planner(place.field, place.robot, request.settings, occupancy=occupancy)
    for step in clock.time(_steps(request, place, finder, occupancy)):
        last = step
        yield step
        yield Progress("optimising", min(1.0, (step.iteration + 1) / request.settings.iterations))
    assert last is not None, "a planner yields at least one step"
    yield Progress("judging", 1.0)
    overlap = mesh_overlap_m3(place, last.motion)
    if overlap and last.outcome in GOOD:
        last = replace(last, outcome=PlanOutcome.TOUCHES_MESH)
        yield last
    summary = summary_of(last, place, clock.seconds, overlap, request.max_collision, request.settings.weights.risk)
    return JobResult(summary, () if out is None else save(out, last.motion, place, summary, request.unknown))


def timing_for(request: PlanRequest, place: Place, occupancy: OccupancyMap, keep_dt: bool = False) -> Timing:
    """How long the way that is asked for should take, before it is planned; in steps as long as asked with `keep_dt`.
    """
    problem = PlanProblem(place.field, place.robot, request.ends.start.state(), request.ends.goal.state())
    search = getattr(request.settings, "search", SearchConfig.single())
    length = way_length(problem, map_for(problem, occupancy), search)
    return timing_of(place.robot, length, request.dt, request.dt if keep_dt or request.keep_dt else None)


def _steps(
    request: PlanRequest, place: Place, finder: Planner, occupancy: OccupancyMap
) -> Iterator[PlanStep]:
    """Plan as often as the request asks for: for the duration, then for the bound on collisions."""
    start, goal, dt, last = request.ends.start.state(), request.ends.goal.state(), request.dt, None
    if request.shortest:
        timing = timing_for(request, place, occupancy)
        dt = timing.dt
        steps = shortest_plan(lambda count: finder.plan(Route(start, goal, count, dt)), place.robot, timing.config)
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
    yield from within_chance(problem, last, careful, request.max_collision, occupancy)

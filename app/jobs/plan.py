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
from nerfnav.planner.chance import within_chance
from nerfnav.planner.duration import shortest_plan


def run(request: PlanRequest, place: Place) -> JobEvents:
    """Yield every iteration of the planner; return the numbers of the last one and what was written.

    Raises NerfnavError where the request cannot be worked with.
    """
    entry, place = planners.load(request.planner), planning_place(place, request.unknown)
    out = None if request.out is None else prepare_folder(request.out)
    yield Progress("finding a way", 0.0)
    clock, last = Stopwatch(), None
    with clock.running():
        occupancy = occupancy_of(place, request.settings.occupancy)
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
    summary = summary_of(last, place, clock.seconds, overlap, request.max_collision)
    return JobResult(summary, () if out is None else save(out, last.motion, place, summary))


def _steps(
    request: PlanRequest, place: Place, finder: Planner, occupancy: OccupancyMap
) -> Iterator[PlanStep]:
    """Plan as often as the request asks for: for the duration, then for the bound on collisions."""
    start, goal, dt, last = request.ends.start.state(), request.ends.goal.state(), request.dt, None
    if request.shortest:
        steps = shortest_plan(lambda count: finder.plan(Route(start, goal, count, dt)), place.robot)
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

"""Compare job: plan with several planners between the same ends."""

from collections.abc import Generator

from nerfnav.core.errors import NerfnavError
from nerfnav.planner import PlanStep
from nerfnav_app.jobs.events import JobEvent, JobEvents, JobResult, JobRun, PlannerCompared, PlannerResult, Progress
from nerfnav_app.jobs.plan import plan
from nerfnav_app.places.place import Place


def run(routes: list[plan.PlanRequest], place: Place) -> JobEvents:
    """Yield what each planner has found, in the order of `routes`; a planner that refuses says why."""
    for number, route in enumerate(routes):
        yield Progress(f"planning with {route.planner}", number / len(routes))
        yield PlannerCompared((yield from _result(route, place, number, len(routes))))
    return JobResult({"planners": len(routes)})


def _result(
    route: plan.PlanRequest, place: Place, number: int, count: int
) -> Generator[JobEvent, bool | None, PlannerResult]:
    last, planning = None, JobRun(plan.run(route, place))
    try:
        for event in planning:
            match event:
                case PlanStep():
                    last = event
                case Progress(label, fraction):
                    yield Progress(f"{label} with {route.planner}", (number + fraction) / count)
    except NerfnavError as error:
        return PlannerResult(route.planner, None, {}, str(error))
    return PlannerResult(route.planner, None if last is None else last.motion, planning.result.summary)

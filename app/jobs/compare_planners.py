"""Compare: let several planners find their way between the same ends."""

from collections.abc import Generator, Iterator

from app.jobs import plan
from app.jobs.events import JobEvent, JobFinished, PlannerCompared, PlannerResult, Progress
from app.jobs.plan import PlanRequest
from app.places.place import Place
from nerfnav.errors import NerfnavError
from nerfnav.planner.steps import PlanStep


def run(routes: list[PlanRequest], place: Place) -> Iterator[JobEvent]:
    """Yield what each planner has found, in the order of `routes`; a planner that refuses says why."""
    for number, route in enumerate(routes):
        yield Progress(f"planning with {route.planner}", number / len(routes))
        yield PlannerCompared((yield from _result(route, place, number, len(routes))))
    yield JobFinished("compare", {"planners": len(routes)})


def _result(route: PlanRequest, place: Place, number: int, count: int) -> Generator[JobEvent, None, PlannerResult]:
    last, summary = None, {}
    try:
        for event in plan.run(route, place):
            match event:
                case PlanStep():
                    last = event
                case Progress(label, fraction):
                    yield Progress(f"{label} with {route.planner}", (number + fraction) / count)
                case JobFinished():
                    summary = event.summary
    except NerfnavError as error:
        return PlannerResult(route.planner, None, {}, str(error))
    return PlannerResult(route.planner, None if last is None else last.motion, summary)

"""Compare: let several planners find their way between the same ends."""

from collections.abc import Generator, Iterator

from app.jobs import plan
from app.jobs.events import JobEvent, JobFinished, Progress
from app.jobs.plan import PlanRequest
from app.places.place import Place
from app.state.actions import Compared
from app.state.records import Rival
from nerfnav.errors import NerfnavError
from nerfnav.planner.steps import PlanStep


def run(routes: list[PlanRequest], place: Place) -> Iterator[JobEvent | Compared]:
    """Yield what each planner has found, in the order of `routes`; a planner that refuses says why."""
    for number, route in enumerate(routes):
        yield Progress(f"planning with {route.planner}", number / len(routes))
        yield Compared((yield from _rival(route, place, number, len(routes))))
    yield JobFinished("compare", {"planners": len(routes)})


def _rival(route: PlanRequest, place: Place, number: int, count: int) -> Generator[JobEvent, None, Rival]:
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
        return Rival(route.planner, None, {}, str(error))
    return Rival(route.planner, None if last is None else last.motion, summary)

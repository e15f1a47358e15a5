"""The plan that a session wants: as a request, and carried out."""

from contextlib import suppress
from typing import Any

from app.jobs import plan
from app.jobs.events import JobRun
from app.jobs.plan_request import PlanRequest
from app.places.ends import Ends
from app.places.place import Place
from app.state.plan_settings import PlanSettings
from nerfnav.errors import NerfnavError
from nerfnav.planner import PlannerConfig, PlanStep


def plan_request(settings: PlanSettings, ends: Ends, planner: str, own: PlannerConfig | None) -> PlanRequest:
    """What there is to plan between some ends with what a person has set; `own` where nobody changed the weights."""
    request = PlanRequest(ends, planner=planner, config=settings.config(planner, own), shortest=settings.shortest)
    return request.lasting(settings.duration_s)


def planned(
    settings: PlanSettings, ends: Ends, planner: str, own: PlannerConfig | None, place: Place
) -> tuple[tuple[PlanStep, ...], dict[str, Any]]:
    """Plan as the job does: the iterations and the job's numbers, as far as it came before it was refused."""
    steps: list[PlanStep] = []
    summary: dict[str, Any] = {}
    with suppress(NerfnavError):  # the ends are shown with what is wrong with them
        planning = JobRun(plan.run(plan_request(settings, ends, planner, own), place))
        for event in planning:
            if isinstance(event, PlanStep):
                steps.append(event)
        summary = planning.result.summary
    return tuple(steps), summary

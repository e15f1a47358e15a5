"""nerfnav plan: from a start and a goal to a trajectory."""

from collections.abc import Sequence
from dataclasses import dataclass, field, make_dataclass, replace
from pathlib import Path
from typing import Any, Literal

from nerfnav.core.errors import NerfnavError
from nerfnav.planner import PlannerConfig, PlanOutcome
from nerfnav_app.cli.progress import run_and_print
from nerfnav_app.cli.route_arguments import Route, planner_of
from nerfnav_app.jobs.plan.plan import run as run_job

UNTRUE = (PlanOutcome.LIKELY_COLLISION, PlanOutcome.TOUCHES_MESH)
"""Outcomes of plans that look good and are not."""


class UnsafePlanError(NerfnavError):
    """A plan that would hurt the robot."""


@dataclass(frozen=True)
class Arguments(Route):
    """Plan a trajectory through a field, and judge it on the ground truth where there is one."""

    duration: float | Literal["auto"] | None = None
    """How long the robot takes [s], in place of --steps; auto: the shortest time that keeps its limits (of long ways,
    within a half). By default 2 s for the tasks of a scene, elsewhere auto."""
    max_collision: float | None = None
    """Refine the plan until the bound on its probability of a collision is at most this."""
    out: Path | None = None
    """Folder for trajectory.csv, trajectory.json and plan.json."""


def arguments_for(words: Sequence[str]) -> type[Any]:
    """The arguments with the settings of the planner that the words ask for, as --config."""
    own = planner_of(words).config()
    settings = ("config", type(own), field(default=own))
    chosen = make_dataclass("Arguments", [settings], bases=(Arguments,), frozen=True)
    chosen.__doc__ = Arguments.__doc__
    return chosen


def run(arguments: Any) -> None:
    """Plan, and print the numbers of the plan."""
    place = arguments.open()
    settings: PlannerConfig = arguments.config
    asked = arguments.request(place, settings)
    request = replace(
        asked,
        shortest=arguments.duration == "auto" or (arguments.duration is None and asked.shortest),
        max_collision=arguments.max_collision,
        out=arguments.out,
    )
    if isinstance(arguments.duration, float):
        request = request.lasting(arguments.duration)
    summary = run_and_print(f"plan in {place.name}", run_job(request, place), arguments.json).summary
    untrue = next((outcome for outcome in UNTRUE if outcome.name.lower() == summary["outcome"]), None)
    if untrue is not None:
        raise UnsafePlanError(f"this plan is not safe to fly: {untrue.value}")

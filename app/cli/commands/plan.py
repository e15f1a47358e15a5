"""nerfnav plan: from a start and a goal to a trajectory."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from tyro.conf import arg

from nerfnav.core.errors import NerfnavError
from nerfnav.planner import PlanOutcome
from nerfnav_app.cli.arguments import Route, find_planner, with_settings
from nerfnav_app.cli.progress import run_and_print
from nerfnav_app.jobs.plan.plan import run as run_job

UNSAFE = (PlanOutcome.LIKELY_COLLISION, PlanOutcome.TOUCHES_MESH)
"""Outcomes of plans that are not safe, although the planner has converged."""


class UnsafePlanError(NerfnavError):
    """Error: the plan is likely to collide, or touches the mesh."""


@dataclass(frozen=True)
class Arguments(Route):
    """Plan a trajectory through a field, and judge it on the ground truth where there is one."""

    duration: Annotated[float | Literal["auto"] | None, arg(metavar="FLOAT|auto")] = None
    """Duration [s], in place of --steps; auto: the shortest that keeps the robot's limits (default: 2 for tasks,
    else auto). Of long paths, auto finds it within a half."""
    max_collision: float | None = None
    """Largest bound on the probability of a collision: the plan is refined until it keeps it."""
    out: Path | None = None
    """Folder for trajectory.csv, trajectory.json and plan.json."""


def arguments_for(words: Sequence[str]) -> type[Any]:
    """Make the arguments with the settings of the planner that the words name."""
    return with_settings(Arguments, find_planner(words).config())


def run(arguments: Any) -> None:
    """Plan, and print the numbers of the plan."""
    place = arguments.open()
    asked = arguments.request(place, arguments.config)
    request = replace(
        asked,
        shortest=arguments.duration == "auto" or (arguments.duration is None and asked.shortest),
        max_collision=arguments.max_collision,
        out=arguments.out,
    )
    if isinstance(arguments.duration, float):
        request = request.lasting(arguments.duration)
    summary = run_and_print(f"plan in {place.name}", run_job(request, place), arguments.json).summary
    unsafe = next((outcome for outcome in UNSAFE if outcome.name.lower() == summary["outcome"]), None)
    if unsafe is not None:
        raise UnsafePlanError(f"this plan is not safe to fly: {unsafe.value}")

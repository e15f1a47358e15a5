"""nerfnav plan: from a start and a goal to a trajectory."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from nerfnav.core.errors import NerfnavError
from nerfnav.navigation import NavigateConfig, WorldName
from nerfnav.planner import PlanOutcome
from nerfnav.robots import StateNoise
from nerfnav_app.cli.arguments import Route, find_planner, note_blindness, note_move, with_settings
from nerfnav_app.cli.progress import run_and_print
from nerfnav_app.jobs.plan.plan import run as run_job

UNSAFE = (PlanOutcome.LIKELY_COLLISION, PlanOutcome.TOUCHES_MESH)
"""Outcomes of plans that are not safe, although the planner has converged."""


class UnsafePlanError(NerfnavError):
    """Error: the plan is likely to collide, or touches the mesh."""


@dataclass(frozen=True)
class Arguments(Route):
    """Plan a trajectory through a field, and judge it on the ground truth where there is one."""

    world: WorldName = "paper"
    """World of the flight that the plan is for, see `nerfnav fly`."""
    noise: StateNoise = field(default_factory=StateNoise)
    """Noise of that flight in each step."""
    out: Path | None = None
    """Folder for trajectory.csv, trajectory.json and plan.json."""


def arguments_for(words: Sequence[str]) -> type[Any]:
    """Make the arguments with the settings of the planner that the words name."""
    return with_settings(Arguments, find_planner(words).config())


def run(arguments: Any) -> None:
    """Plan, and print the numbers of the plan."""
    place = arguments.open()
    flight = NavigateConfig(noise=arguments.noise)
    request = replace(arguments.request(place, arguments.config, None, flight, arguments.world), out=arguments.out)
    summary = run_and_print(f"plan in {place.name}", run_job(request, place), arguments.json).summary
    note_move(summary)
    note_blindness(summary, arguments.max_blind, place.field.info.is_draft)
    unsafe = next((outcome for outcome in UNSAFE if outcome.name.lower() == summary["outcome"]), None)
    if unsafe is not None:
        raise UnsafePlanError(f"this plan is not safe to fly: {unsafe.value}")

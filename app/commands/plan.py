"""nerfnav plan: from a start and a goal to a trajectory."""

from collections.abc import Sequence
from dataclasses import dataclass, field, make_dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

from app.commands.screen import follow, show
from app.commands.values import PLANNER, Route
from app.jobs.plan import PlanSettings
from app.jobs.plan import run as run_job
from app.registry import PLAN_CONFIGS, named
from nerfnav.errors import NerfnavError
from nerfnav.planner.steps import PlanOutcome

UNTRUE = (PlanOutcome.LIKELY_COLLISION, PlanOutcome.TOUCHES_MESH)
"""Outcomes of plans that look good and are not."""


class UnsafePlanError(NerfnavError):
    """A plan that would hurt the robot."""


@dataclass(frozen=True)
class Arguments(Route):
    """Plan a trajectory through a field, and judge it on the ground truth where there is one."""

    duration: float | Literal["auto"] | None = None
    """How long the robot takes [s], in place of --steps; auto: the shortest time that keeps its limits."""
    max_collision: float | None = None
    """Refine the plan until the bound on its probability of a collision is at most this."""
    out: Path | None = None
    """Folder for trajectory.csv, trajectory.json and plan.json."""


def arguments_for(words: Sequence[str]) -> type[Any]:
    """The arguments with the settings of the planner that the words ask for, as --config."""
    planner = PLANNER
    for word, following in pairwise([*words, ""]):
        if word == "--planner" or word.startswith("--planner="):
            planner = word.partition("=")[2] or following
    make = named("planner", planner, PLAN_CONFIGS)
    settings = ("config", type(make()), field(default_factory=make))
    chosen = make_dataclass("Arguments", [settings], bases=(Arguments,), frozen=True)
    chosen.__doc__ = Arguments.__doc__
    return chosen


def run(arguments: Any) -> None:
    """Plan, and print the numbers of the plan."""
    place = arguments.open()
    settings: PlanSettings = arguments.config
    request = replace(
        arguments.request(place, settings),
        shortest=arguments.duration == "auto",
        max_collision=arguments.max_collision,
        out=arguments.out,
    )
    if isinstance(arguments.duration, float):
        request = request.lasting(arguments.duration)
    summary = follow(run_job(request, place)).summary
    show(f"plan in {place.name}", summary, arguments.json)
    untrue = next((outcome for outcome in UNTRUE if outcome.name.lower() == summary["outcome"]), None)
    if untrue is not None:
        raise UnsafePlanError(f"this plan is not safe to fly: {untrue.value}")

"""nerfnav plan: from a start and a goal to a trajectory."""

from dataclasses import dataclass, field, replace
from pathlib import Path

from app.commands.screen import follow, show
from app.commands.values import Route
from app.jobs.plan import run as run_job
from app.place import open_place
from nerfnav.planner.optimize import PlanConfig


@dataclass(frozen=True)
class Arguments(Route):
    """Plan a trajectory through a field, and judge it on the ground truth where there is one."""

    out: Path | None = None
    """Folder for trajectory.csv, trajectory.json and plan.json."""
    config: PlanConfig = field(default_factory=PlanConfig.paper)


def run(arguments: Arguments) -> None:
    """Plan, and print the numbers of the plan."""
    place = open_place(arguments.place, arguments.robot)
    request = replace(arguments.request(place, arguments.config), out=arguments.out)
    show(f"plan in {place.name}", follow(run_job(request, place)).summary, arguments.json)

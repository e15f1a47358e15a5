"""nerfnav fly: the whole loop, with a simulated camera."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from app.cli.route_arguments import Route
from app.cli.terminal import follow, note, show
from app.jobs.fly import FlyRequest
from app.jobs.fly import run as run_job
from app.storage.run_store import RunStore
from nerfnav.navigation.replan import NavigateConfig


@dataclass(frozen=True)
class Arguments(Route):
    """Fly with nothing but a simulated camera, replanning at every step; Ctrl-C lands and keeps what was flown."""

    estimator: str = "fast"
    """Which pose filter."""
    covariance: Literal["gauss-newton", "exact"] = "gauss-newton"
    """How the fast filter tells how sure it is: from what its steps know anyway, or by the exact second derivatives
    of the paper, which takes longer."""
    open_loop: bool = False
    """Fly the first plan blindly: no pictures, no replanning."""
    seed: int = 0
    """Seed of everything random: noise, first belief, choice of pixels."""
    out: Path | None = None
    """Folder for the flight: run.json, steps.jsonl, pictures, and at the end episode.npz, episode.json,
    trajectory.csv, trajectory.json; by default a new one in runs/ (or where NERFNAV_RUNS points)."""
    config: NavigateConfig = field(default_factory=NavigateConfig)


def run(arguments: Arguments) -> None:
    """Fly, and print the numbers of the flight."""
    place = arguments.open()
    config = arguments.config
    if arguments.covariance == "exact":
        config = replace(config, filter=replace(config.filter, exact_covariance=True))
    request = FlyRequest(
        arguments.request(place, arguments.config.plan),
        estimator=arguments.estimator,
        open_loop=arguments.open_loop,
        seed=arguments.seed,
        config=config,
        source=arguments.place,
        task=arguments.task_name(place),
        out=arguments.out or RunStore().new(place.name),
    )
    show(f"flight in {place.name}", follow(run_job(request, place), can_stop_early=True).summary, arguments.json)
    if arguments.out is None:
        note(f"the flight is kept in {request.out}")

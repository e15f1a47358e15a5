"""nerfnav fly: the whole loop, with a simulated camera."""

from dataclasses import dataclass, field
from pathlib import Path

from app.commands.screen import follow, show
from app.commands.values import Route
from app.jobs.fly import FlyRequest
from app.jobs.fly import run as run_job
from nerfnav.navigation.replan import NavigateConfig


@dataclass(frozen=True)
class Arguments(Route):
    """Fly with nothing but a simulated camera, replanning at every step; Ctrl-C lands and keeps what was flown."""

    estimator: str = "paper"
    """Which pose filter."""
    open_loop: bool = False
    """Fly the first plan blindly: no pictures, no replanning."""
    seed: int = 0
    """Seed of everything random: noise, first belief, choice of pixels."""
    out: Path | None = None
    """Folder for the flight: episode.npz, episode.json, trajectory.csv, trajectory.json."""
    config: NavigateConfig = field(default_factory=NavigateConfig)


def run(arguments: Arguments) -> None:
    """Fly, and print the numbers of the flight."""
    place = arguments.open()
    request = FlyRequest(
        arguments.request(place, arguments.config.plan),
        estimator=arguments.estimator,
        open_loop=arguments.open_loop,
        seed=arguments.seed,
        config=arguments.config,
        out=arguments.out,
    )
    show(f"flight in {place.name}", follow(run_job(request, place), can_stop_early=True).summary, arguments.json)

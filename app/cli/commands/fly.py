"""nerfnav fly: the whole loop, with a simulated camera."""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, make_dataclass, replace
from pathlib import Path
from typing import Any, Literal

from nerfnav.geometry import read_camera
from nerfnav.navigation import NavigateConfig, WorldName
from nerfnav_app.cli.progress import run_and_print
from nerfnav_app.cli.route_arguments import Route, planner_of
from nerfnav_app.cli.terminal import note
from nerfnav_app.jobs.fly.fly import run as run_job
from nerfnav_app.jobs.fly.request import FlyRequest
from nerfnav_app.storage.run_store import RunStore


@dataclass(frozen=True)
class Arguments(Route):
    """Fly with nothing but a simulated camera, replanning at every step; Ctrl-C lands and keeps what was flown."""

    estimator: str = "fast"
    """Which pose filter."""
    covariance: Literal["gauss-newton", "exact"] = "gauss-newton"
    """How the fast filter tells how sure it is: from what its steps know anyway, or by the exact second derivatives
    of the paper, which takes longer."""
    camera: Path | None = None
    """What the robot sees with, calibrated by ROS, OpenCV, nerfstudio or COLMAP; by default the robot's own camera."""
    open_loop: bool = False
    """Fly the first plan blindly: no pictures, no replanning."""
    world: WorldName = "paper"
    """The paper's noise at each time step, or a physical world with motors, drag, wind and late pictures (quadrotors
    alone), where --duration auto gives a flight time for wind."""
    realtime: bool = False
    """Let the world go on while filter and planner compute: steps that take longer than dt are late, and counted."""
    seed: int = 0
    """Seed of everything random: noise, first belief, choice of pixels."""
    out: Path | None = None
    """Folder for the flight: run.json, steps.jsonl, pictures, and at the end episode.npz, episode.json,
    trajectory.csv, trajectory.json; by default a new one in runs/ (or where NERFNAV_RUNS points)."""


def arguments_for(words: Sequence[str]) -> type[Any]:
    """The arguments with --config: how the flight is flown, and as --config.plan and --config.replan the settings of
    the planner that the words ask for."""
    entry = planner_of(words)
    own = {"plan": entry.config(), "replan": entry.again(entry.config())}
    planning = [(name, type(settings), field(default=settings)) for name, settings in own.items()]
    config = make_dataclass("Config", planning, bases=(NavigateConfig,), frozen=True)
    config.__doc__ = NavigateConfig.__doc__
    chosen = make_dataclass("Arguments", [("config", config, field(default=config()))], bases=(Arguments,), frozen=True)
    chosen.__doc__ = Arguments.__doc__
    return chosen


def run(arguments: Any) -> None:
    """Fly, and print the numbers of the flight."""
    place, asked = arguments.open(), arguments.config
    if arguments.camera is not None:
        place = place.seen_with(read_camera(arguments.camera))
    config = NavigateConfig(**{part.name: getattr(asked, part.name) for part in fields(NavigateConfig)})
    if arguments.covariance == "exact":
        config = replace(config, filter=replace(config.filter, exact_covariance=True))
    again = arguments.replanning(asked.plan, asked.replan)
    route = replace(arguments.request(place, asked.plan), again=again)
    request = FlyRequest(
        route,
        estimator=arguments.estimator,
        open_loop=arguments.open_loop,
        seed=arguments.seed,
        world=arguments.world,
        realtime=arguments.realtime,
        config=config,
        source=arguments.place,
        task=arguments.task_name(place),
        out=arguments.out or RunStore().new(place.name),
    )
    run_and_print(f"flight in {place.name}", run_job(request, place), arguments.json, can_stop_early=True)
    if arguments.out is None:
        note(f"the flight is kept in {request.out}")

"""nerfnav fly: the whole loop, with a simulated camera."""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, make_dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from tyro.conf import Suppress, arg

from nerfnav.estimator import estimators
from nerfnav.formats import read_camera
from nerfnav.navigation import NavigateConfig, WorldName
from nerfnav_app.cli.arguments import Route, find_planner, note_blindness, note_move, with_settings
from nerfnav_app.cli.progress import run_and_print
from nerfnav_app.cli.terminal import note
from nerfnav_app.jobs.fly.fly import run as run_job
from nerfnav_app.jobs.fly.request import FlyRequest
from nerfnav_app.places.place import Place
from nerfnav_app.storage.run_store import RunStore


@dataclass(frozen=True)
class Arguments(Route):
    """Fly with nothing but a simulated camera, replanning at every step; Ctrl-C lands and keeps what was flown."""

    estimator: Annotated[str, arg(help=f"Pose filter: {', '.join(estimators.names())}.")] = "fast"
    covariance: Literal["gauss-newton", "exact"] = "gauss-newton"
    """Covariance of the fast filter: by Gauss-Newton, or as in the paper, slower."""
    camera: Path | None = None
    """Calibration of the robot's camera by ROS, OpenCV, Kalibr, EuRoC, nerfstudio or COLMAP (default: its own)."""
    open_loop: bool = False
    """Fly the first plan blindly: no pictures, no replanning."""
    fly_on: bool = False
    """Count a contact with the mesh and fly on, as the paper's evaluation does (default: a contact ends the flight)."""
    world: WorldName = "paper"
    """World: the paper's noise at each time step, or motors, drag, wind and late pictures. The physical one is for
    quadrotors alone; there --duration auto gives a flight time for wind."""
    realtime: bool = False
    """Let the world go on while filter and planner compute: steps longer than dt are late, and counted."""
    imu: bool = False
    """Inertial unit: it measures turns and body rates."""
    watch: bool = False
    """Look for what the map does not show; keep clear."""
    seed: int = 0
    """Seed of everything random: noise, first belief, choice of pixels."""
    out: Path | None = None
    """Folder for the flight (default: a new one in runs/, or in $NERFNAV_RUNS). It gets run.json, steps.jsonl,
    pictures, and at the end episode.npz, episode.json, trajectory.csv and trajectory.json."""


def arguments_for(words: Sequence[str]) -> type[Any]:
    """Make the arguments with the settings of the flight, and as --plan and --replan those of the named planner."""
    entry = find_planner(words)
    own = {"plan": entry.config(), "replan": entry.again(entry.config())}
    planning = [(name, type(settings), field(default=settings)) for name, settings in own.items()]
    # --open-loop, --fly-on and --imu are options of the command itself: the settings keep names that help does not list
    known = [
        (name, Annotated[bool, arg(name=f"config.{name.replace('_', '-')}"), Suppress], field(default=False))
        for name in ("open_loop", "fly_on", "imu")
    ]
    about = {"__doc__": NavigateConfig.__doc__}
    config = make_dataclass("Config", [*planning, *known], bases=(NavigateConfig,), frozen=True, namespace=about)
    return with_settings(Arguments, config())


def make_request(arguments: Any, place: Place) -> FlyRequest:
    """Make the request of a flight in the place of the arguments."""
    asked = arguments.config
    config = NavigateConfig(**{part.name: getattr(asked, part.name) for part in fields(NavigateConfig)})
    config = replace(config, fly_on=arguments.fly_on or config.fly_on, imu=arguments.imu or config.imu)
    if arguments.covariance == "exact":
        config = replace(config, filter=replace(config.filter, exact_covariance=True))
    watches = arguments.watch or place.has_seen
    return FlyRequest(
        replace(arguments.request(place, asked.plan, asked.replan, config, arguments.world), watch=watches),
        estimator=arguments.estimator,
        open_loop=arguments.open_loop,
        seed=arguments.seed,
        realtime=arguments.realtime,
        source=arguments.place,
        task=arguments.task_name(place),
        camera=arguments.camera,
        obstacles=arguments.obstacles,
        out=arguments.out,
    )


def run(arguments: Any) -> None:
    """Fly, and print the numbers of the flight."""
    place = arguments.open()
    if arguments.camera is not None:
        place = place.seen_with(read_camera(arguments.camera))
    request = make_request(arguments, place)
    request = replace(request, out=request.out or RunStore().new(place.name))
    title = f"flight in {place.name}"
    summary = run_and_print(title, run_job(request, place), arguments.json, can_stop_early=True).summary
    note_move(summary)
    note_blindness(summary, arguments.max_blind, place.field.info.is_draft)
    if arguments.out is None:
        note(f"the flight is kept in {request.out}")

"""Fly: Algorithm 1 in a simulated world, from a plan to an episode."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import torch

from app.jobs.events import JobEvents, JobFinished, JobStarted, Progress
from app.jobs.export import TRAJECTORY
from app.jobs.plan import PlanRequest
from app.places.place import Place, occupancy_of, planning_place, searcher_of
from app.storage.output_files import prepare_folder, write_text
from app.storage.run_metadata import RunMetadata
from app.storage.step_log import logged
from nerfnav.estimator import estimators
from nerfnav.estimator.filter import FilterConfig
from nerfnav.estimator.photometric import ColorNoise
from nerfnav.estimator.relocalise import RelocaliseStep
from nerfnav.export.tables import csv_text, episode_table, json_text
from nerfnav.field.render import render_image
from nerfnav.geometry.camera import Camera
from nerfnav.navigation.episode import Episode
from nerfnav.navigation.orders import Orders
from nerfnav.navigation.replan import Mission, NavigateConfig, Pilot, navigate
from nerfnav.navigation.simulator import CameraFunction, ContactFunction, Simulator
from nerfnav.navigation.steps import LoopEvent, NavigationStep
from nerfnav.planner import planners
from nerfnav.planner.steps import PlanStep
from nerfnav.robots.state import Motion

CAMERA = Camera.from_fov(200, 200, 90)
"""What the robot sees with: as wide as the field's own photographs."""


@dataclass(frozen=True)
class FlyRequest:
    """What to fly."""

    route: PlanRequest
    """From where to where, and how plans are made; its `out` is not used."""
    plan: Motion | None = None
    """The first plan where it is already made, from the route's start to its goal."""
    estimator: str = "fast"
    """Name of the estimator."""
    open_loop: bool = False
    """Fly the first plan blindly."""
    seed: int = 0
    """Seed of everything random: noise, first belief, choice of pixels."""
    config: NavigateConfig = field(default_factory=NavigateConfig)
    """How the flight is flown."""
    orders: Callable[[], Orders] = Orders
    """Asked at each time step for what has changed on the way."""
    source: str = ""
    """What was opened, for the record: scene name or field file; empty means the place's name."""
    task: str | None = None
    """The scene's task that is flown, for the record; None where the ends were chosen freely."""
    out: Path | None = None
    """Folder for the log, which grows with each step, then the episode and trajectory.csv, trajectory.json; None
    writes nothing."""


def run(request: FlyRequest, place: Place) -> JobEvents:
    """Yield what planner, filter and loop yield, then the numbers of the flight and what was written.

    Send True to land early: the flight so far is then reported and stored, with the outcome "stopped".
    Raises NerfnavError where the request cannot be worked with.
    """
    out = None if request.out is None else prepare_folder(request.out)
    yield JobStarted("fly")
    yield Progress("finding a way", 0.0)
    flown: list[NavigationStep] = []
    with logged(out, _about(request, place), lambda episode: summary_of(episode, place)) as log:
        for event in _begin(request, place):
            if log is not None and isinstance(event, NavigationStep):
                log.append(event)
            stop = yield event
            if isinstance(event, NavigationStep):
                flown.append(event)
                stop = (yield Progress("flying", min(1.0, event.index / request.route.steps))) or stop
            elif isinstance(event, PlanStep) and not flown:
                fraction = min(1.0, (event.iteration + 1) / request.route.settings.iterations)
                stop = (yield Progress("optimising the first plan", fraction)) or stop
            elif isinstance(event, RelocaliseStep):
                stop = (yield Progress("looking everywhere for the robot", event.fraction)) or stop
            if stop and flown:
                break
    episode = Episode.of(flown)
    summary = summary_of(episode, place)
    yield JobFinished("fly", summary, () if out is None else save(out, episode, place))


def summary_of(episode: Episode, place: Place) -> dict[str, Any]:
    """What `fly --json` prints."""
    unjudged = {} if place.truth else {"mesh_collision_steps": None}
    return episode.metrics() | unjudged


def save(folder: Path, episode: Episode, place: Place) -> tuple[Path, ...]:
    """Write a flight's files into `folder`."""
    table = episode_table(episode, place.robot.action_names, place.robot.name)
    return (
        *episode.save(folder),
        write_text(folder / "trajectory.csv", csv_text(table)),
        write_text(folder / TRAJECTORY, json_text(table)),
    )


def _about(request: FlyRequest, place: Place) -> RunMetadata:
    route = request.route
    return RunMetadata(
        place=place.name,
        source=request.source or place.name,
        robot=place.robot.name,
        planner=route.planner,
        estimator=request.estimator,
        seed=request.seed,
        dt=route.dt,
        ends=route.ends,
        task=request.task,
        open_loop=request.open_loop or request.config.open_loop,
    )


def _begin(request: FlyRequest, place: Place) -> Iterator[LoopEvent]:
    route, seen_as = request.route, planning_place(place, request.route.unknown)
    estimator = estimators.load(request.estimator)
    occupancy = occupancy_of(seen_as, route.settings.occupancy)
    planner = planners.load(route.planner).planner(
        seen_as.field, place.robot, route.settings, route.again, occupancy
    )
    config = replace(request.config, open_loop=request.open_loop or request.config.open_loop)
    config = replace(config, filter=_with_noise_of(config.filter, place))
    generator = torch.Generator().manual_seed(request.seed)
    pilot = Pilot(
        planner,
        estimator.make(place.field, place.robot, CAMERA, config=config.filter),
        searcher_of(place, CAMERA, config.filter.color_noise),
    )
    simulator = Simulator(
        place.robot, route.ends.start.state(), _camera(place), generator, noise=config.noise, contact=_contact(place)
    )
    mission = Mission(route.ends.goal.state(), route.steps, route.dt, request.plan, request.orders)
    return navigate(mission, simulator, pilot, config, generator)


def _with_noise_of(config: FilterConfig, place: Place) -> FilterConfig:
    """The colour noise that was measured for this field, unless another was asked for."""
    asked = config.color_noise.std != ColorNoise.std
    return config if asked else config.for_field(place.field.info.noise_std)


def _contact(place: Place) -> ContactFunction | None:
    """What tells whether the robot touches the ground truth; None where there is none."""
    if place.scene is None:
        return None
    from nerfnav.world.contact import contact_check  # slow to import, and people see the place before

    return contact_check(place.scene, place.robot.body)


def _camera(place: Place) -> CameraFunction:
    """Pictures of the ground truth; of the field where there is none."""
    if place.scene is None:
        return lambda pose: render_image(place.field, CAMERA, pose).image
    from nerfnav.world.raycast import MeshRenderer  # slow to import, as above

    renderer = MeshRenderer(place.scene, supersample=2)  # as the photographs that the field learned from
    return lambda pose: renderer.render(CAMERA, pose).image

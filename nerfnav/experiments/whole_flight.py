"""One flight by Algorithm 1, set up as `nerfnav fly` does it, and what it shows."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import torch
from torch import Tensor

from nerfnav import robots
from nerfnav.errors import OccupiedError, OutsideBoxError
from nerfnav.estimator import ColorNoise, LastingError, Searcher, estimators
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.flight_row import row_of, steps_of
from nerfnav.experiments.known_state import KNOWN, KnownState
from nerfnav.experiments.random_ends import random_task
from nerfnav.experiments.study import Row
from nerfnav.experiments.views import renderer_of
from nerfnav.field import Unknown, planning_field
from nerfnav.geometry import Camera, Pose
from nerfnav.navigation import (
    WORLDS,
    LoopEvent,
    Mission,
    NavigateConfig,
    NavigationStep,
    Pilot,
    Simulator,
    WorldName,
    guarded,
    navigate,
    with_late_pictures,
    world_generator,
)
from nerfnav.planner import FastPlanConfig, OccupancyConfig, OccupancyMap, PlanProblem, planners, timing_of, way_length
from nerfnav.planner.duration import is_hurried
from nerfnav.world import MeshRenderer, Task, contact_check


@dataclass(frozen=True)
class FlightTrial:
    """One trial."""

    task: Task | None
    """From where to where, in 20 steps of 0.1 s where so many can be enough, else as long as the way takes; None:
    between random ends, drawn by the seed, as long as the way takes."""
    seed: int
    """Of everything random in it."""
    known: bool = False
    """Whether the robot is told its state, and needs no pictures."""
    world: WorldName = "paper"
    """Where it happens."""
    risk: float | None = None
    """What a collision by noise costs [J]; None: as flights have it."""
    robot: str | None = None
    """Name or file of what flies; None: what the task is for."""


def fly(arena: Arena, trial: FlightTrial) -> Row:
    """Fly: `row` of the table, and `steps`, lists of what was measured at each time step."""
    task = _task(arena, trial)
    problem = _problem(arena, task, trial)
    told = {
        "ends": "tasks" if trial.task else "random", "task": task.name, "robot": problem.robot.name, "seed": trial.seed,
        "state": "known" if trial.known else "camera", "world": trial.world,
        "planned_steps": problem.steps,
        "start": _words(*task.start, task.start_yaw), "goal": _words(*task.goal, task.goal_yaw),
    }  # fmt: skip
    done = _steps(arena, problem, trial)
    steps = steps_of(done)
    return {"row": told | row_of(done, task.goal_state, steps), "steps": steps}


def flown(arena: Arena, trial: FlightTrial) -> list[NavigationStep]:
    """The time steps of one; none where it cannot begin."""
    return _steps(arena, _problem(arena, _task(arena, trial), trial), trial)


def _steps(arena: Arena, problem: PlanProblem, trial: FlightTrial) -> list[NavigationStep]:
    try:
        return [event for event in _flight(arena, problem, trial) if isinstance(event, NavigationStep)]
    except (OccupiedError, OutsideBoxError):
        return []


def _task(arena: Arena, trial: FlightTrial) -> Task:
    """From where to where, for the robot that flies."""
    if trial.task is None:
        return random_task(arena, trial.seed, None if trial.robot is None else _robot(trial.robot))
    return trial.task if trial.robot is None else replace(trial.task, robot=trial.robot)


def _problem(arena: Arena, task: Task, trial: FlightTrial) -> PlanProblem:
    """What is to be planned, in the field with what no camera saw taken for solid."""
    robot = _planned(task.robot, trial.world)
    field = planning_field(arena.field, Unknown.OCCUPIED)
    problem = PlanProblem(field, robot, task.start_state, task.goal_state)
    seconds = problem.steps * problem.dt
    if trial.task is not None and not is_hurried(robot, math.dist(task.start, task.goal), seconds):
        return problem
    weights = planners.load("fast").in_flight(FastPlanConfig(), trial.risk).weights
    length = way_length(problem, _map(arena, problem), FastPlanConfig(weights=weights).ways)
    return replace(problem, steps=timing_of(robot, length, problem.dt, problem.dt).steps)


def _flight(arena: Arena, problem: PlanProblem, trial: FlightTrial) -> Iterator[LoopEvent]:
    world = WORLDS[trial.world]
    config = world.expecting(NavigateConfig())
    config = replace(config, filter=config.filter.for_field(arena.field.info))
    robot, draws = _robot(problem.robot.source), world_generator(trial.seed)
    entry, settings = planners.load("fast"), FastPlanConfig()
    where, again = (problem.field, _map(arena, problem), problem.robot), entry.in_flight(settings, trial.risk)
    planner, guard = guarded(entry, where, settings, again, config.noise)
    contact = contact_check(arena.scene, robot.body)
    look = partial(_black if trial.known else partial(_photo, _renderer(arena)), robot.camera)
    simulator = world.simulated(
        Simulator(robot, problem.start, look, draws, robot.mount, noise=config.noise, contact=contact)
    )
    if trial.known:
        config, pilot = replace(config, initial=KNOWN), Pilot(planner, KnownState(simulator), guard=guard)
    else:
        make, camera = estimators.load("fast").make, robot.camera
        lasting = LastingError(arena.field.info.pose_floor, robot.mount)
        estimator = make(arena.field, robot, camera, mount=robot.mount, config=config.filter)
        searcher = _searcher(arena, camera, config.filter.color_noise)
        pilot = Pilot(planner, estimator, searcher, guard, arena.field, lasting)
        pilot = with_late_pictures(pilot, simulator)
    mission = Mission(problem.goal, problem.steps, problem.dt)
    return navigate(mission, simulator, pilot, config, torch.Generator().manual_seed(trial.seed))


def _photo(renderer: MeshRenderer, camera: Camera, pose: Pose) -> Tensor:
    return renderer.render(camera, pose).image


def _black(camera: Camera, pose: Pose) -> Tensor:
    """What nobody looks at."""
    return torch.zeros(camera.height, camera.width, 3, dtype=torch.uint8)


@lru_cache(maxsize=2)
def _renderer(arena: Arena) -> MeshRenderer:
    return renderer_of(arena)


@lru_cache(maxsize=1)
def _searcher(arena: Arena, camera: Camera, noise: ColorNoise) -> Searcher:
    """Made once in each process."""
    return Searcher(arena.field, camera, noise)


def _map(arena: Arena, problem: PlanProblem) -> OccupancyMap:
    """Made once for each robot, and for each height of one on the ground."""
    return _map_at(arena, problem.robot.source, problem.start.position[2].item() if problem.robot.planar else None)


@lru_cache(maxsize=4)
def _map_at(arena: Arena, robot: str, height: float | None) -> OccupancyMap:
    field = planning_field(arena.field, Unknown.OCCUPIED)
    return OccupancyMap.of(field, _robot(robot).body, OccupancyConfig(), height)


@lru_cache
def _robot(name: str) -> robots.Robot:
    """One object for each, by which planners know again what they have made for it."""
    return robots.load(name)


@lru_cache
def _planned(name: str, world: WorldName) -> robots.Robot:
    """The same as planners take it in a world."""
    return WORLDS[world].planned(_robot(name))


def _words(*numbers: float) -> str:
    """An end, as `nerfnav fly --start` takes it."""
    return " ".join(f"{number:.9g}" for number in numbers)

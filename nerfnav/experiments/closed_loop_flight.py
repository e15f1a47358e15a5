"""Closed-loop flight: one flight by Algorithm 1, set up as `nerfnav fly` does it, and its row of the table.

Its ends are those of a task, or random: at rest anywhere in a place, free on the ground truth and for planners. With
state feedback an estimator reads the true state, as a bound on what any filter could do.
"""


import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav import robots
from nerfnav.core.errors import InvalidInputError, OccupiedError, OutsideBoxError
from nerfnav.estimator import (
    Belief,
    ColorNoise,
    ConsiderCovariance,
    FilterOutcome,
    FilterResult,
    FilterStep,
    FilterUpdate,
    GlobalLocalizer,
    estimators,
)
from nerfnav.experiments.estimation import errors_of
from nerfnav.experiments.held_out_views import make_renderer
from nerfnav.experiments.study import Arena, Row
from nerfnav.field import UnknownSpace, planning_field
from nerfnav.geometry import Camera, Pose
from nerfnav.navigation import (
    WORLDS,
    FlightRequest,
    LoopEvent,
    NavigateConfig,
    NavigationStack,
    NavigationStep,
    Simulator,
    WorldName,
    build_safe_planner,
    compensate_latency,
    navigate,
    world_generator,
)
from nerfnav.planner import (
    FastPlanConfig,
    OccupancyConfig,
    OccupancyMap,
    PlanProblem,
    estimate_timing,
    fits,
    path_length,
    planners,
)
from nerfnav.planner.solvers.duration import is_hurried
from nerfnav.robots import Quadrotor, RigidState, Robot, StateNoise
from nerfnav.world import MeshRenderer, Task, contact_check

REFUSED = "refused"
"""Outcome where the field has something dense at an end."""
_OFF, _IN_A_ROW = 0.05, 3


def steps_of(flown: Sequence[NavigationStep]) -> Row:
    """Lists over the time steps after the start: errors [m], NEES, whether the truth lies inside the belief's 95 %
    ellipsoid of position, whether the robot holds, and times [ms]."""
    errors = [errors_of(step.belief, step.truth) for step in flown[1:]]
    return {
        "position_m": [error["position_m"] for error in errors],
        "nees": [error["nees"] for error in errors],
        "inside_95": [error["inside_95"] for error in errors],
        "holds": [step.holds for step in flown[1:]],
        "filter_ms": [step.filter_ms for step in flown[1:]],
        "replan_ms": [step.replan_ms for step in flown[1:]],
        "step_ms": [step.filter_ms + step.replan_ms for step in flown[1:]],
    }


def row_of(flown: Sequence[NavigationStep], goal: RigidState, steps: Row) -> Row:
    """The numbers of one flight; None where there are none."""
    last = flown[-1] if flown else None
    outcome = REFUSED if last is None or last.outcome is None else last.outcome.name.lower()
    return {
        "outcome": outcome,
        "steps": len(steps["nees"]),
        "hits_expected": flown[0].hits_expected if flown else None,
        "touches": sum(step.touched for step in flown),
        "final_m": None if last is None else (last.truth.position - goal.position).norm().item(),
        "position_median_m": quantile(steps["position_m"], 0.5),
        "position_p95_m": quantile(steps["position_m"], 0.95),
        "nees_mean": mean(steps["nees"]),
        "inside_95": mean(steps["inside_95"]),
        "silent": is_silent(steps),
        "held": sum(steps["holds"]),
        **times_of(steps),
    }


def times_of(steps: Row) -> Row:
    """Median, 95th percentile and most of the times [ms] of some time steps."""
    return {
        f"{name}_{what}_ms": quantile(steps[f"{name}_ms"], share)
        for name in ("filter", "replan", "step")
        for what, share in (("p50", 0.5), ("p95", 0.95), ("max", 1.0))
    }


def is_silent(steps: Row) -> bool:
    """Silent divergence: for three time steps in a row the believed position is more than 5 cm off, the truth lies
    outside the belief's 95 % ellipsoid, and the robot does not say by holding that it is in doubt."""
    run = 0
    for off, inside, holds in zip(steps["position_m"], steps["inside_95"], steps["holds"], strict=True):
        run = run + 1 if off > _OFF and not inside and not holds else 0
        if run == _IN_A_ROW:
            return True
    return False


def mean(values: Sequence[float]) -> float | None:
    """None of nothing."""
    return float(np.mean(values)) if values else None


def quantile(values: Sequence[float], share: float) -> float | None:
    """A quantile; None of nothing."""
    return float(np.quantile(values, share)) if values else None


KNOWN = StateNoise.isotropic(1e-8)
"""Spread of a belief that is the truth: not zero, for covariances are inverted."""


@dataclass(frozen=True)
class TrueStateEstimator:
    """An estimator that looks at the simulator's state instead of at pictures."""

    simulator: Simulator
    """Knows where the robot is."""

    def update(
        self, belief: Belief, image: Tensor | None, action: Float[Tensor, " a"], dt: float, generator: torch.Generator
    ) -> FilterUpdate:
        """The true state, whatever the arguments (see Estimator)."""
        truth = Belief(self.simulator.state, KNOWN.covariance())
        step = FilterStep(0, truth.mean, 0.0, 0.0, torch.zeros(0, 2, dtype=torch.long), torch.zeros(0))
        yield step
        return FilterResult(truth, FilterOutcome.UPDATED, step)


SPARE = 0.08
"""Room around the body that both ends have on the mesh [m]."""
APART = 0.25
"""Least distance of the ends [share of the box's longest edge]."""
_DRAWS = 5000


def random_task(arena: Arena, seed: int, robot: Robot | None = None) -> Task:
    """A flight of a robot (default: the paper's) between two ends drawn evenly from the box, with any headings.

    Between some of them there may be no way. Raises InvalidInputError where the place has no room for such ends.
    """
    robot = Quadrotor() if robot is None else robot
    generator = torch.Generator().manual_seed(seed)
    apart, body = APART * float(arena.field.box.size.max()), robot.body
    field, touches = planning_field(arena.field, UnknownSpace.OCCUPIED), contact_check(arena.scene, body.grown(SPARE))
    ends: list[tuple[tuple[float, float, float], float]] = []
    for _ in range(_DRAWS):
        drawn = torch.rand(4, generator=generator)
        x, y, z = (arena.field.box.lower + drawn[:3] * arena.field.box.size).tolist()
        point, yaw = (x, y, z), math.tau * (drawn[3].item() - 0.5)
        if ends and math.dist(point, ends[0][0]) < apart:
            continue
        state = RigidState.at_rest(point, yaw)
        if fits(field, body, state) and not touches(state, state):
            ends.append((point, yaw))
        if len(ends) == 2:
            (start, start_yaw), (goal, goal_yaw) = ends
            return Task(f"random {seed}", start, goal, start_yaw, goal_yaw, robot.source)
    raise InvalidInputError(
        f"{arena.scene.name} has no two ends {apart:.2g} m apart with {100 * SPARE:g} cm to spare: fly its tasks"
    )


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


def fly_steps(arena: Arena, trial: FlightTrial) -> list[NavigationStep]:
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
    field = planning_field(arena.field, UnknownSpace.OCCUPIED)
    problem = PlanProblem(field, robot, task.start_state, task.goal_state)
    seconds = problem.steps * problem.dt
    if trial.task is not None and not is_hurried(robot, math.dist(task.start, task.goal), seconds):
        return problem
    weights = planners.load("fast").in_flight(FastPlanConfig(), trial.risk).weights
    length = path_length(problem, _map(arena, problem), FastPlanConfig(weights=weights).ways)
    return replace(problem, steps=estimate_timing(robot, length, problem.dt, problem.dt).steps)


def _flight(arena: Arena, problem: PlanProblem, trial: FlightTrial) -> Iterator[LoopEvent]:
    world = WORLDS[trial.world]
    config = world.expecting(NavigateConfig())
    config = replace(config, filter=config.filter.for_field(arena.field.info))
    robot, draws = _robot(problem.robot.source), world_generator(trial.seed)
    entry, settings = planners.load("fast"), FastPlanConfig()
    where, again = (problem.field, _map(arena, problem), problem.robot), entry.in_flight(settings, trial.risk)
    planner, guard = build_safe_planner(entry, where, settings, again, config.noise)
    contact = contact_check(arena.scene, robot.body)
    look = partial(_black if trial.known else partial(_photo, _renderer(arena)), robot.camera)
    simulator = world.simulated(
        Simulator(robot, problem.start, look, draws, robot.mount, noise=config.noise, contact=contact)
    )
    if trial.known:
        config, pilot = (
            replace(config, initial=KNOWN),
            NavigationStack(planner, TrueStateEstimator(simulator), guard=guard),
        )
    else:
        make, camera = estimators.load("fast").make, robot.camera
        lasting = ConsiderCovariance(arena.field.info.pose_floor, robot.mount)
        estimator = make(arena.field, robot, camera, mount=robot.mount, config=config.filter)
        searcher = _searcher(arena, camera, config.filter.color_noise)
        pilot = NavigationStack(planner, estimator, searcher, guard, arena.field, lasting)
        pilot = compensate_latency(pilot, simulator)
    mission = FlightRequest(problem.goal, problem.steps, problem.dt)
    return navigate(mission, simulator, pilot, config, torch.Generator().manual_seed(trial.seed))


def _photo(renderer: MeshRenderer, camera: Camera, pose: Pose) -> Tensor:
    return renderer.render(camera, pose).image


def _black(camera: Camera, pose: Pose) -> Tensor:
    """What nobody looks at."""
    return torch.zeros(camera.height, camera.width, 3, dtype=torch.uint8)


@lru_cache(maxsize=2)
def _renderer(arena: Arena) -> MeshRenderer:
    return make_renderer(arena)


@lru_cache(maxsize=1)
def _searcher(arena: Arena, camera: Camera, noise: ColorNoise) -> GlobalLocalizer:
    """Made once in each process."""
    return GlobalLocalizer(arena.field, camera, noise)


def _map(arena: Arena, problem: PlanProblem) -> OccupancyMap:
    """Made once for each robot, and for each height of one on the ground."""
    return _map_at(arena, problem.robot.source, problem.start.position[2].item() if problem.robot.planar else None)


@lru_cache(maxsize=4)
def _map_at(arena: Arena, robot: str, height: float | None) -> OccupancyMap:
    field = planning_field(arena.field, UnknownSpace.OCCUPIED)
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

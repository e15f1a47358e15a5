"""Closed-loop flight: one flight by Algorithm 1, set up as `nerfnav fly` does it.

Its ends are those of a task, or random: at rest anywhere in a place, free on the ground truth and for planners. With
state feedback an estimator reads the true state, as an upper bound for all filters.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav import robots
from nerfnav.core.errors import InvalidInputError, OccupiedError, OutsideBoxError
from nerfnav.estimator import (
    Belief,
    ConsiderCovariance,
    FilterOutcome,
    FilterResult,
    FilterStep,
    FilterUpdate,
    estimators,
)
from nerfnav.experiments.arena import Arena, make_renderer, make_searcher
from nerfnav.field import Field, UnknownSpace, planning_field
from nerfnav.geometry import Pose
from nerfnav.navigation import (
    LEVEL,
    WORLDS,
    FlightRequest,
    FlightStep,
    Gyroscopes,
    NavigateConfig,
    NavigationStack,
    NavigationStep,
    Simulator,
    Watch,
    WorldName,
    build_safe_planner,
    estimate_flight_time,
    expect_noise,
    navigate,
    use_inertial_unit,
    world_generator,
)
from nerfnav.obstacles import Overlay
from nerfnav.planner import (
    FastPlanConfig,
    Movers,
    OccupancyConfig,
    OccupancyMap,
    PlanProblem,
    PlanResult,
    close_holes,
    fits,
    planners,
    settle_ends,
)
from nerfnav.planner.solvers.duration import is_hurried
from nerfnav.robots import Motion, NoiseModel, Quadrotor, RigidState, Robot, StateNoise
from nerfnav.world import Task, contact_check, level_contact_check

KNOWN = StateNoise.isotropic(1e-8)
"""Standard deviations of an exact belief: not zero, for covariances are inverted."""


@dataclass(frozen=True)
class TrueStateEstimator:
    """State feedback: an estimator that returns the simulator's state."""

    simulator: Simulator
    """Simulator with the true state."""

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

    Some may have no path between them. Raises InvalidInputError where the place has no room for such ends.
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
    """Trial of the experiment: one flight."""

    task: Task | None
    """Start and goal, in 20 steps of 0.1 s where they can suffice, else as long as the path takes; None: random ends,
    drawn by the seed, as long as the path takes."""
    seed: int
    """Of everything random in it."""
    known: bool = False
    """State feedback in place of pictures."""
    world: WorldName = "paper"
    """World of the flight."""
    risk: float | None = None
    """Cost of a collision by noise [J]; None: the default of flights."""
    robot: str | None = None
    """Name or file of what flies; None: what the task is for."""
    fly_on: bool = False
    """Fly on after a contact, which is counted."""
    open_loop: bool = False
    """Fly the first plan blindly."""
    imu: bool = False
    """The robot has an inertial unit in the paper's world too."""


@dataclass(frozen=True)
class Traffic:
    """Obstacles that move in a flight, and what the robot knows of them."""

    movers: Movers | None
    """The obstacles; None: there are none."""
    announced: bool = True
    """The planner knows their motion."""
    masked: bool = True
    """The filter leaves out the pixels that they cover, where they are announced or seen."""
    watched: bool = False
    """The robot looks for them in its pictures."""


def fly_steps(arena: Arena, trial: FlightTrial) -> list[NavigationStep]:
    """Fly a trial and return its time steps; none where it cannot begin."""
    return fly_problem(arena, make_problem(arena, find_task(arena, trial), trial), trial)


def fly_problem(
    arena: Arena,
    problem: PlanProblem,
    trial: FlightTrial,
    plan: Motion | None = None,
    traffic: Traffic | None = None,
) -> list[NavigationStep]:
    """Fly the problem of a trial and return its time steps; none where it cannot begin.

    `plan` is a first plan that is already made; None: plan now. `traffic` are obstacles that move.
    """
    supports = settle_ends(arena.field, problem.field, problem.robot, problem.start, problem.goal)
    if any(support.footing.is_refused for support in supports):
        return []
    try:
        return [event for event in _flight(arena, problem, trial, plan, traffic) if isinstance(event, NavigationStep)]
    except (OccupiedError, OutsideBoxError):
        return []


def first_plan(arena: Arena, problem: PlanProblem, trial: FlightTrial, traffic: Traffic | None = None) -> Motion | None:
    """Plan the problem of a trial as a flight does before take-off; None where it cannot begin.

    Headings are chosen for the camera where there is `traffic`.
    """
    trial = replace(trial, known=trial.known or traffic is None)
    events = _flight(arena, problem, trial, None, traffic)
    first = next((event for event in events if isinstance(event, PlanResult)), None)
    return None if first is None else first.motion


def find_task(arena: Arena, trial: FlightTrial) -> Task:
    """Task of a trial, for the robot that flies."""
    if trial.task is None:
        return random_task(arena, trial.seed, None if trial.robot is None else _robot(trial.robot))
    return trial.task if trial.robot is None else _stand(arena, replace(trial.task, robot=trial.robot))


def _stand(arena: Arena, task: Task) -> Task:
    """Put the ends of another robot's task on the floor; those without one stay, and are refused before take-off."""
    robot = _robot(task.robot)
    if not robot.planar:
        return task
    field = planning_field(arena.field, UnknownSpace.OCCUPIED)
    supports = settle_ends(arena.field, field, robot, task.start_state, task.goal_state)
    first, last = (round(support.state.position[2].item(), 4) for support in supports)
    return replace(task, start=(*task.start[:2], first), goal=(*task.goal[:2], last))


def make_problem(arena: Arena, task: Task, trial: FlightTrial) -> PlanProblem:
    """Plan problem in the field with unobserved space taken for solid."""
    robot = _planned(task.robot, trial.world)
    field = _field_at(arena, robot.source, task.start_state.position[2].item() if robot.planar else None)
    problem = PlanProblem(field, robot, task.start_state, task.goal_state)
    if trial.task is not None and not is_hurried(robot, math.dist(task.start, task.goal), problem.steps * problem.dt):
        return problem
    weights = planners.load("fast").in_flight(FastPlanConfig(), trial.risk).weights
    timing = estimate_flight_time(problem, _map(arena, problem), FastPlanConfig(weights=weights), problem.dt)
    return replace(problem, steps=timing.steps)


def _flight(
    arena: Arena, problem: PlanProblem, trial: FlightTrial, plan: Motion | None, traffic: Traffic | None
) -> Iterator[FlightStep]:
    world = WORLDS[trial.world]
    config = world.configure(NavigateConfig(open_loop=trial.open_loop, fly_on=trial.fly_on, imu=trial.imu))
    config = replace(config, filter=config.filter.for_field(arena.field.info))
    robot, draws = _robot(problem.robot.source), world_generator(trial.seed)
    entry, settings = planners.load("fast"), FastPlanConfig()
    again, occupancy = entry.in_flight(settings, trial.risk), _map(arena, problem)
    expected = not trial.known and trial.world == "paper"  # an inertial unit tells more than pictures
    noise = expect_noise(arena.field, occupancy, robot, config) if expected else NoiseModel(config.noise)
    planner, safety_filter = build_safe_planner(
        entry, problem.field, occupancy, problem.robot, settings, noise, again,
        movers=None if traffic is None or not traffic.announced else traffic.movers,
    )  # fmt: skip

    def look(pose: Pose) -> Tensor:
        if trial.known:  # no one looks at the picture
            return torch.zeros(robot.camera.height, robot.camera.width, 3, dtype=torch.uint8)
        return make_renderer(arena).render(robot.camera, pose).image

    movers = None if traffic is None else traffic.movers
    overlay = None if movers is None or trial.known else Overlay(movers.obstacles)

    def look_at_traffic(pose: Pose, time: float) -> Tensor:
        assert overlay is not None
        seen = make_renderer(arena).render(robot.camera, pose)
        return overlay.draw(seen.image, seen.fine_depth, robot.camera, pose, time)

    contact = contact_check(arena.scene, robot.body)
    simulator = world.simulate(Simulator(
        robot, problem.start, look, draws, robot.mount, noise=config.noise, contact=contact, box=problem.field.box,
        level_contact=level_contact_check(arena.scene, robot.body, LEVEL),
        movers=movers, camera_at=None if overlay is None else look_at_traffic,
        gyroscopes=Gyroscopes(trial.seed) if config.imu else None,
    ))  # fmt: skip
    if trial.known:
        config = replace(config, initial=KNOWN)
        stack = NavigationStack(planner, TrueStateEstimator(simulator), safety_filter=safety_filter)
    else:
        map_error = ConsiderCovariance(arena.field.info.pose_floor, robot.mount)
        estimator = estimators.load("fast").make(
            arena.field, robot, robot.camera, mount=robot.mount, config=config.filter
        )
        searcher = make_searcher(arena, robot.camera, config.filter.color_noise)
        stack = NavigationStack(planner, estimator, searcher, safety_filter, arena.field, map_error)
        if overlay is not None and traffic is not None and traffic.announced and traffic.masked:
            stack = replace(stack, hidden=partial(overlay.covered, robot.camera))
        if traffic is not None and traffic.watched:
            stack = replace(stack, watch=Watch.of(arena.field, robot, masks=traffic.masked))
        stack = use_inertial_unit(stack, simulator)
    request = FlightRequest(problem.goal, problem.steps, problem.dt, plan)
    return navigate(request, simulator, stack, config, torch.Generator().manual_seed(trial.seed))


def _map(arena: Arena, problem: PlanProblem) -> OccupancyMap:
    """Made once for each robot, and for each height of one on the ground."""
    return _map_at(arena, problem.robot.source, problem.start.position[2].item() if problem.robot.planar else None)


@lru_cache(maxsize=4)
def _map_at(arena: Arena, robot: str, height: float | None) -> OccupancyMap:
    return OccupancyMap.of(_field_at(arena, robot, height), _robot(robot).body, OccupancyConfig(), height)


@lru_cache(maxsize=4)
def _field_at(arena: Arena, robot: str, height: float | None) -> Field:
    """Field to plan in, with the holes closed of the floor that a robot drives on at a height [m]."""
    field = planning_field(arena.field, UnknownSpace.OCCUPIED)
    return field if height is None else close_holes(field, _robot(robot), height)


@lru_cache
def _robot(name: str) -> robots.Robot:
    """One object for each, by which planners know again what they have made for it."""
    return robots.load(name)


@lru_cache
def _planned(name: str, world: WorldName) -> robots.Robot:
    """The same as planners take it in a world."""
    return WORLDS[world].planning_robot(_robot(name))

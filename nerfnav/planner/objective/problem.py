"""Planning problem: robot, field and ends to plan between, checked, with a first path as initial guess."""

import math
from collections.abc import Generator
from dataclasses import dataclass
from dataclasses import field as dataclass_field
from enum import Enum
from functools import cached_property

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.steps import run_steps
from nerfnav.field import Field
from nerfnav.geometry import so3
from nerfnav.planner import terms
from nerfnav.planner.moving.movers import Movers
from nerfnav.planner.moving.timing import PathTiming, time_along
from nerfnav.planner.risk.collision_map import CollisionMap, relative_cost
from nerfnav.planner.risk.costs import CostWeights
from nerfnav.planner.risk.tracking_error import RiskContext
from nerfnav.planner.space.astar import TURN, SearchConfig, find_paths, lengths, smooth_path, waypoints_along
from nerfnav.planner.space.ends import check_ends, check_finite
from nerfnav.planner.space.occupancy import OccupancyConfig, OccupancyMap
from nerfnav.planner.space.scales import Scales
from nerfnav.planner.steps import PlanStep
from nerfnav.planner.terms.movers import movers_term
from nerfnav.planner.terms.term import CostTerm, Evaluated, TermContext, evaluate
from nerfnav.planner.trajectory import Route, Trajectory
from nerfnav.robots import PAPER_NOISE, Motion, NoiseModel, RigidState, Robot

_SHARE = 0.7
"""Share of a robot's speed and acceleration that first guesses take when they let movers pass."""
_HURRY, _LEAST_SPEED = 4.0, 0.1
"""Speed of a robot without a limit, as a multiple of the mean; at least so much [m/s]."""
_ROOM = 0.06
"""Distance from movers of the first guesses that wait for them [m]."""


class InitialGuess(Enum):
    """Start of the optimisation."""

    ASTAR = "a way around what is occupied"
    STRAIGHT = "the straight line, through everything"


@dataclass(frozen=True)
class PlanProblem:
    """Planning problem: a robot in a field, between two states."""

    field: Field
    """Field to plan in."""
    robot: Robot
    """Robot to plan for."""
    start: RigidState
    """Met exactly at time 0."""
    goal: RigidState
    """Met exactly at the last time."""
    steps: int = 20
    """Number of time steps; 20 in the paper."""
    dt: float = 0.1
    """Length of a step [s]; 0.1 in the paper."""
    terms: tuple[CostTerm, ...] = dataclass_field(default_factory=terms.list_terms)
    """Terms of J: by default those of Eq. 2 and all that were registered."""
    noise: NoiseModel = PAPER_NOISE
    """Noise of the flight, for plans that count risk."""
    overdue: bool = False
    """True if the arrival is put off at each step, see terms/risk.py."""
    keeps_headings: bool = False
    """True if the search leaves the headings of a trajectory as they are, see Route."""
    risk_dt: float | None = None
    """Length of the steps [s] in whose noise risk counts; None: dt. Each takes a collision map of its own."""
    movers: Movers | None = None
    """Announced obstacles that move; None: all stands."""
    time: float = 0.0
    """Time of the flight at the start [s], of which the places of movers are functions."""

    @property
    def route(self) -> Route:
        """Return the ends and the time steps."""
        return Route(self.start, self.goal, self.steps, self.dt, self.keeps_headings, self.time)

    @cached_property
    def counted(self) -> tuple[CostTerm, ...]:
        """Return the terms of J, with that of movers where there are some."""
        return self.terms if self.movers is None else (*self.terms, movers_term(self.movers, self.time))

    def touches_movers(self, motion: Motion) -> bool:
        """Check whether the body of a motion from the start on touches a mover on its way."""
        if self.movers is None:
            return False
        gaps = self.movers.least_gaps(motion.states, motion.dt, self.robot.body, self.time)
        return bool((gaps <= 0).any())

    def context(self, weights: CostWeights) -> TermContext:
        """Return the context of the terms."""
        return TermContext(self.field, self.robot, weights, self.risk_context)

    @property
    def risk_context(self) -> RiskContext:
        """Return the properties of the flight on which risk depends."""
        apart = (self.goal.position - self.start.position).norm().item()
        pace = max(apart, self.robot.body.radius) / self.steps if self.overdue else None
        height = self.start.position[2].item() if self.robot.planar else None
        end = (*self.goal.position.tolist(), so3.yaw_of(self.goal.rotation).item()) if self.overdue else None
        return RiskContext(self.risk_dt or self.dt, self.noise, pace, height, end)

    def trajectory_through(self, waypoints: Float[Tensor, "times 4"]) -> Trajectory:
        """Follow waypoints (x, y, z [m], yaw [rad]) as nearly as ends and dynamics allow."""
        return Trajectory(self.robot.encode(waypoints, self.start, self.goal, self.dt), self.route)

    def cost(self, motion: Motion, weights: CostWeights) -> Evaluated:
        """Evaluate the terms of J for a motion."""
        return evaluate(self.counted, self.context(weights), motion)

    @torch.no_grad()
    def evaluate(self, trajectory: Trajectory, weights: CostWeights) -> PlanStep:
        """Evaluate the motion and J of a trajectory."""
        motion = trajectory.motion(self.robot)
        return PlanStep(0, trajectory, motion, self.cost(motion, weights).numbers())


@dataclass(frozen=True)
class FirstGuesses:
    """First guesses of the optimisation."""

    trajectories: tuple[Trajectory, ...]
    """Trajectories along the paths that were found, at least one; along the straight line where there is none."""
    leads: bool
    """True if there is a path from start to goal at all."""
    timed: tuple[Trajectory, ...] = ()
    """Along the same paths, but timed so that movers are let pass; none without movers, and where that does not help.
    """


def first_guess(
    problem: PlanProblem, initial: InitialGuess, occupancy: OccupancyMap | OccupancyConfig
) -> FirstGuesses:
    """Make the first guess along the best path alone, see `first_guesses`."""
    return first_guesses(problem, initial, occupancy, SearchConfig.single())


def first_guesses(
    problem: PlanProblem,
    initial: InitialGuess,
    occupancy: OccupancyMap | OccupancyConfig,
    search: SearchConfig,
) -> FirstGuesses:
    """Check the ends and search paths between them, on a map that is made here if only its config is given.

    Raises InvalidInputError, OutsideBoxError or OccupiedError for ends that cannot be planned between.
    """
    return paths_between(problem, initial, checked_map(problem, occupancy), search)


def checked_map(problem: PlanProblem, occupancy: OccupancyMap | OccupancyConfig) -> OccupancyMap:
    """Return the map to search on, see `map_for`, once the ends are checked.

    Raises InvalidInputError, OutsideBoxError or OccupiedError for ends that cannot be planned between.
    """
    for name, state in (("start", problem.start), ("goal", problem.goal)):
        check_finite(name, state)
    problem.robot.check_ends(problem.start, problem.goal)
    occupancy = map_for(problem, occupancy)
    check_ends(problem.field, problem.robot.body, problem.start, problem.goal, occupancy)
    return occupancy


def paths_between(
    problem: PlanProblem, initial: InitialGuess, occupancy: OccupancyMap, search: SearchConfig
) -> FirstGuesses:
    """Search paths between ends that are taken as they are, such as a robot's that finds itself next to a wall."""
    straight = torch.stack([problem.start.position, problem.goal.position])
    if initial is InitialGuess.STRAIGHT:
        return FirstGuesses((_along(problem, straight),), True)
    found, scales = _paths(problem, occupancy, search), occupancy.scales
    if not found:
        return FirstGuesses((_along(problem, straight),), False)
    first, *others = (scales.rounding * rounding for rounding in search.roundings)
    paths = [_smooth(path, first, scales) for path in found]
    paths[1:1] = [_smooth(found[0], rounding, scales) for rounding in others]
    paths += [straight] if search.straight else []
    timed = [time_guess(problem, _smooth(path, first, scales), scales.turn) for path in found]
    guesses = tuple(_along(problem, path, scales.turn) for path in paths)
    return FirstGuesses(guesses, True, tuple(guess for guess in timed if guess is not None))


def path_length(problem: PlanProblem, occupancy: OccupancyMap, search: SearchConfig) -> float:
    """Measure the best path from start to goal [m], turns included; the straight line where there is none."""
    found = _paths(problem, occupancy, search)
    if found:
        scales = occupancy.scales
        return lengths(_smooth(found[0], scales.rounding, scales), scales.turn).sum().item()
    return (problem.goal.position - problem.start.position).norm().item()


def _paths(problem: PlanProblem, occupancy: OccupancyMap, search: SearchConfig) -> list[Float[Tensor, "_ c"]]:
    extra = run_steps(price_risk(problem, occupancy, search))
    return find_paths(occupancy, problem.start, problem.goal, search, extra)


def price_risk(
    problem: PlanProblem, occupancy: OccupancyMap, search: SearchConfig
) -> Generator[None, None, Float[np.ndarray, "m nx ny nz"] | None]:
    """Return the cost of a metre by risk in each voxel of a search; None where it does not count.

    Yields between the two maps that it takes, each of which may take a second; both are kept.
    """
    if not search.danger:
        return None
    chances = CollisionMap.of(problem.field, problem.robot, problem.risk_context)
    yield
    return relative_cost(chances, occupancy, search.danger)


def map_for(problem: PlanProblem, occupancy: OccupancyMap | OccupancyConfig) -> OccupancyMap:
    """Return the map to search on: of the start's height alone for a robot that never leaves it."""
    config = occupancy if isinstance(occupancy, OccupancyConfig) else occupancy.config
    height = problem.start.position[2].item() if problem.robot.planar else None
    if isinstance(occupancy, OccupancyMap) and (height is None or occupancy.is_of(height)):
        return occupancy
    return OccupancyMap.of(problem.field, problem.robot.body, config, height)


def _smooth(path: Float[Tensor, "n c"], rounding: float, scales: Scales) -> Float[Tensor, "m c"]:
    return smooth_path(path, rounding, scales.turn, scales.path_step)


def _along(
    problem: PlanProblem, path: Float[Tensor, "n c"], turn: float = TURN, share: Float[Tensor, " times"] | None = None
) -> Trajectory:
    waypoints = waypoints_along(path, problem.start, problem.goal, problem.steps, turn, share)
    return problem.trajectory_through(waypoints)


def time_guess(problem: PlanProblem, path: Float[Tensor, "n c"], turn: float = TURN) -> Trajectory | None:
    """Follow a path so that movers are let pass; None without movers, and where waiting on the path does not help."""
    if problem.movers is None:
        return None
    robot, mean = problem.robot, lengths(path[:, :3]).sum().item() / (problem.steps * problem.dt)
    timing = PathTiming(
        problem.time, problem.steps, problem.dt, problem.start.velocity.norm().item(),
        _SHARE * (robot.most("speed") or max(_HURRY * mean, _LEAST_SPEED)),
        _SHARE * (robot.acceleration or math.inf), _ROOM,
    )  # fmt: skip
    share = time_along(path[:, :3].double().numpy(), problem.movers, problem.robot.body, timing)
    return None if share is None else _along(problem, path, turn, torch.from_numpy(share).to(path))

"""What is to be planned, and where every planner starts: the ends checked, and a first way between them."""

from dataclasses import dataclass
from enum import Enum

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.field.field import Field
from nerfnav.planner.astar import find_path, smooth_path, waypoints_along
from nerfnav.planner.ends import check_ends, check_finite
from nerfnav.planner.occupancy import OccupancyConfig, OccupancyMap
from nerfnav.planner.trajectory import Trajectory
from nerfnav.robots.robot import Robot
from nerfnav.robots.state import RigidState


class InitialGuess(Enum):
    """Where the optimisation starts."""

    ASTAR = "a way around what is occupied"
    STRAIGHT = "the straight line, through everything"


@dataclass(frozen=True)
class PlanProblem:
    """What is to be planned."""

    field: Field
    """Where."""
    robot: Robot
    """Who."""
    start: RigidState
    """Met exactly at time 0."""
    goal: RigidState
    """Met exactly at the last time."""
    steps: int = 20
    """Number of time steps; 20 in the paper."""
    dt: float = 0.1
    """Length of a step [s]; 0.1 in the paper."""


@dataclass(frozen=True)
class FirstGuess:
    """A trajectory to begin with."""

    trajectory: Trajectory
    """Along the path, or along the straight line where there is no path."""
    leads: bool
    """Whether there is a way from start to goal at all."""


def first_guess(
    problem: PlanProblem, initial: InitialGuess, occupancy: OccupancyMap | OccupancyConfig
) -> FirstGuess:
    """Check the ends and look for a way between them, on a map that is made here if only its config is given.

    Raises InvalidInputError, OutsideBoxError or OccupiedError for ends that cannot be planned between.
    """
    for name, state in (("start", problem.start), ("goal", problem.goal)):
        check_finite(name, state)
    if isinstance(occupancy, OccupancyConfig):
        occupancy = OccupancyMap.of(problem.field, problem.robot.body, occupancy)
    check_ends(problem.field, problem.robot.body, problem.start, problem.goal, occupancy)
    straight = torch.stack([problem.start.position, problem.goal.position])
    if initial is InitialGuess.STRAIGHT:
        return FirstGuess(_along(problem, straight), True)
    found = find_path(occupancy, problem.start.position, problem.goal.position)
    if found is None:
        return FirstGuess(_along(problem, straight), False)
    return FirstGuess(_along(problem, smooth_path(found)), True)


def _along(problem: PlanProblem, path: Float[Tensor, "n 3"]) -> Trajectory:
    waypoints = waypoints_along(path, problem.start, problem.goal, problem.steps)
    free = problem.robot.encode(waypoints, problem.start, problem.goal, problem.dt)
    return Trajectory(free, problem.start, problem.goal, problem.steps, problem.dt)

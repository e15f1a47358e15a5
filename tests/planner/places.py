"""Small places that several tests plan in."""

from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from nerfnav.core.steps import yield_result
from nerfnav.field.core.protocol import RaySamples, uniform_samples
from nerfnav.field.models.analytic import BallsField
from nerfnav.geometry.box import Box
from nerfnav.planner.objective.problem import PlanProblem
from nerfnav.planner.steps import PlanSteps
from nerfnav.robots.quadrotor import Quadrotor
from nerfnav.robots.state import Motion, RigidState

BOX = Box.of((-1, -1, 0), (1, 1, 1))
WHITE = torch.ones(3)
ROBOT = Quadrotor()


def all_of(steps: PlanSteps) -> list[Any]:
    """Iterations of a planner, then its result."""
    return list(yield_result(steps))


def ball(radius: float = 0.25) -> BallsField:
    """One ball in the middle of an empty box."""
    return BallsField(BOX, torch.tensor([[0.0, 0.0, 0.4]]), torch.tensor([radius]))


@dataclass(frozen=True)
class Colorless:
    """What fields need besides a density."""

    box: Box = BOX
    background: Tensor = WHITE
    resolution: float = 0.01

    def radiance(self, points: Tensor, directions: Tensor) -> Tensor:
        return torch.ones_like(points)

    def samples(self, origins: Tensor, directions: Tensor) -> RaySamples:
        return uniform_samples(self.box, origins, directions, 0.01)


@dataclass(frozen=True)
class Fog(Colorless):
    """The same density everywhere in the box."""

    rho: float = 2.0

    def density(self, points: Tensor) -> Tensor:
        return torch.where(self.box.contains(points), self.rho + 0 * points.sum(-1), 0.0).to(points)


@dataclass(frozen=True)
class Wall(Colorless):
    """A wall across the box at x = 0 with a door, or without."""

    door: float = 0.4
    """Width of the door [m]; 0 for none."""
    thickness: float = 0.2

    def density(self, points: Tensor) -> Tensor:
        x, y, _ = points.unbind(-1)
        inside = (0.5 * self.thickness - x.abs()) / 0.01
        beside = ((y - 0.5).abs() - 0.5 * self.door) / 0.01
        both = torch.sigmoid(inside) * (torch.sigmoid(beside) if self.door else 1.0)
        return torch.where(self.box.contains(points), 200 * both, torch.zeros_like(both))


def across(field: object, robot: Quadrotor = ROBOT, height: float = 0.4) -> PlanProblem:
    """From one side of the box to the other, through its middle."""
    start, goal = RigidState.at_rest((-0.7, 0.02, height)), RigidState.at_rest((0.7, 0.0, height), 0.5)
    return PlanProblem(field, robot, start, goal)  # type: ignore[arg-type]


def straight_motion(start: tuple[float, float, float], goal: tuple[float, float, float], steps: int = 10) -> Motion:
    """A level body that glides evenly from start to goal, with actions of nothing but thrust 1 N."""
    share = torch.linspace(0, 1, steps + 1)[:, None]
    positions = torch.tensor(start) + share * (torch.tensor(goal) - torch.tensor(start))
    still = torch.zeros(steps + 1, 3)
    states = RigidState(positions, still, torch.eye(3).expand(steps + 1, 3, 3), still)
    return Motion(states, torch.tensor([1.0, 0, 0, 0]).expand(steps, 4), 0.1)

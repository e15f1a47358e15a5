"""Ends of a route: start and goal, as the user gives them."""

import math
from dataclasses import dataclass, replace
from enum import Enum

import torch

from nerfnav.geometry import Box, so3
from nerfnav.robots import RigidState, Robot
from nerfnav.world import Task
from nerfnav_app.places.place import Place

Point = tuple[float, float, float]
_TYPED_M = 0.005
"""Tolerance of typed numbers, which are in centimetres."""


class EndRole(Enum):
    """One of the two ends; the value is what the user reads."""

    START = "start"
    GOAL = "goal"


@dataclass(frozen=True)
class End:
    """End of a route: start or goal, level and at rest."""

    position: Point = (0.0, 0.0, 0.0)
    """In the world [m]."""
    yaw: float = 0.0
    """Heading [rad]."""

    def state(self) -> RigidState:
        """State of a robot at this end."""
        return RigidState.at_rest(self.position, self.yaw)

    @classmethod
    def of_state(cls, state: RigidState) -> "End":
        """End of a level state at rest."""
        x, y, z = state.position.tolist()
        return cls((round(x, 4), round(y, 4), round(z, 4)), round(so3.yaw_of(state.rotation).item(), 4))

    def clamp_inside(self, box: Box, robot: Robot) -> "End":
        """The nearest end at which the robot is surely inside the box, its yaw in -pi to pi."""
        lower, upper = _middles(box, robot)
        x, y, z = (
            round(min(max(value, low), high), 4) for value, low, high in zip(self.position, lower, upper, strict=True)
        )
        return End((x, y, z), math.remainder(self.yaw, math.tau))

    def misfits(self, box: Box, robot: Robot) -> list[tuple[str, float, float]]:
        """The axes along which the robot is not surely inside the box, each with the least and largest value [m]."""
        lower, upper = _middles(box, robot)
        rows = zip("xyz", self.position, lower, upper, strict=True)
        return [(axis, low, high) for axis, value, low, high in rows if not low - _TYPED_M <= value <= high + _TYPED_M]


def _middles(box: Box, robot: Robot) -> tuple[list[float], list[float]]:
    """Least and largest position at which the robot is inside the box: in every attitude, or level on the ground."""
    radius = robot.body.radius
    # a long robot on the ground is lower than it is long: its radius above the floor it would hang in the air
    margin = torch.tensor([radius, radius, 0.5 * robot.body.extents[2] if robot.planar else radius])
    return (box.lower.cpu() + margin).tolist(), (box.upper.cpu() - margin).tolist()


@dataclass(frozen=True)
class Ends:
    """Ends of a route: its start and its goal."""

    start: End = End()
    goal: End = End()

    @classmethod
    def of_task(cls, task: Task) -> "Ends":
        """Start and goal of a task."""
        return cls(End(task.start, task.start_yaw), End(task.goal, task.goal_yaw))

    def of(self, which: EndRole) -> End:
        """The start or the goal."""
        return self.start if which is EndRole.START else self.goal

    def moved(self, which: EndRole, end: End) -> "Ends":
        """Replace the start or the goal."""
        return replace(self, start=end) if which is EndRole.START else replace(self, goal=end)


def default_ends(place: Place, task: str | None) -> Ends | None:
    """The ends of a task of the place; without a task, two ends beside the middle of the box; None if unknown."""
    if task is None:
        x, y, z = place.field.box.center.tolist()
        reach = 0.35 * float(place.field.box.size[0])
        return Ends(
            End((round(x - reach, 3), round(y, 3), round(z, 3))), End((round(x + reach, 3), round(y, 3), round(z, 3)))
        )
    return next((Ends.of_task(each) for each in place.tasks if each.name == task), None)

"""A trajectory: the flat waypoints that a planner is free to choose, between fixed ends."""

from dataclasses import dataclass, replace

from jaxtyping import Float
from torch import Tensor

from nerfnav.robots.robot import Robot
from nerfnav.robots.state import Motion, RigidState
from nerfnav.structs import TensorStruct


@dataclass(frozen=True)
class Trajectory(TensorStruct):
    """What the planner optimises; a robot turns it into motion."""

    free: Float[Tensor, " k"]
    """The robot's free numbers, see `Robot.motion`."""
    start: RigidState
    """Met exactly at time 0."""
    goal: RigidState
    """Met exactly at the last time."""
    steps: int
    """Number of time steps."""
    dt: float
    """Length of a step [s]."""

    def motion(self, robot: Robot) -> Motion:
        """The states and actions that this trajectory stands for."""
        return robot.motion(self.free, self.start, self.goal, self.steps, self.dt)

    def with_free(self, free: Float[Tensor, " k"]) -> "Trajectory":
        """The same ends with other free numbers."""
        return replace(self, free=free)

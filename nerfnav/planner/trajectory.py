"""Trajectory: the flat waypoints that a planner may choose, along a route with fixed ends and time steps."""

from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor

from nerfnav.core.structs import TensorStruct
from nerfnav.robots import Motion, RigidState, Robot


@dataclass(frozen=True)
class Route(TensorStruct):
    """Boundary value problem in time: two states, and the steps between them."""

    start: RigidState
    """Met exactly at time 0."""
    goal: RigidState
    """Met exactly at the last time."""
    steps: int = 20
    """Number of time steps; 20 in the paper."""
    dt: float = 0.1
    """Length of a step [s]; 0.1 in the paper."""
    keeps_headings: bool = False
    """True if a plan that is continued keeps the headings that it has (see active_yaw.py)."""
    time: float = 0.0
    """Time of the flight at the start [s], at which movers are where their motions say."""


@dataclass(frozen=True)
class Trajectory(TensorStruct):
    """Trajectory that a planner optimises: free numbers along a route, which a robot turns into motion."""

    free: Float[Tensor, " k"]
    """The robot's free numbers, see `Robot.motion`."""
    route: Route
    """Ends and time steps."""

    @property
    def start(self) -> RigidState:
        """Met exactly at time 0."""
        return self.route.start

    @property
    def steps(self) -> int:
        """Number of time steps."""
        return self.route.steps

    def motion(self, robot: Robot) -> Motion:
        """Compute the states and actions of this trajectory."""
        return motion_of(robot, self.free, self.route)

    def with_free(self, free: Float[Tensor, " k"]) -> "Trajectory":
        """Replace the free numbers between the same ends."""
        return Trajectory(free, self.route)


def motion_of(robot: Robot, free: Float[Tensor, "*batch k"], route: Route) -> Motion:
    """Compute the motion of free numbers along a route."""
    return robot.motion(free, route.start, route.goal, route.steps, route.dt)

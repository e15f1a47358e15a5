"""What every robot can do: turn flat waypoints into motion, and take a step.

Discrete differential flatness: a robot names its free numbers (`free`), such that any value of them gives a motion
that starts at `start`, ends at `goal` and obeys the discrete dynamics of `step`, all exactly. A planner may then
change `free` without constraints.
"""

from abc import ABC, abstractmethod

from jaxtyping import Float
from torch import Tensor

from nerfnav.robots.body import Body
from nerfnav.robots.state import Motion, RigidState


class Robot(ABC):
    """A body that moves."""

    name: str
    """What users call it, as in `--robot`."""
    body: Body
    """Its shape."""
    action_names: tuple[str, ...]
    """Name and unit of each number of an action, e.g. "thrust_n"."""

    @abstractmethod
    def step(self, state: RigidState, action: Float[Tensor, "*batch a"], dt: float) -> RigidState:
        """The state after `dt` [s] under an action: f(x, u), differentiable."""

    @abstractmethod
    def motion(
        self, free: Float[Tensor, "*batch k"], start: RigidState, goal: RigidState, steps: int, dt: float
    ) -> Motion:
        """The motion over `steps` steps of `dt` [s] that the free numbers stand for, from `start` to `goal`."""

    @abstractmethod
    def encode(
        self, waypoints: Float[Tensor, "n+1 4"], start: RigidState, goal: RigidState, dt: float
    ) -> Float[Tensor, " k"]:
        """Free numbers whose motion follows waypoints (x, y, z [m], yaw [rad]), one for each time step.

        The first and last waypoint are start and goal; the ends' exactness wins where the waypoints disagree.
        """

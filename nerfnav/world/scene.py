"""A place as it really is: what is seen, what is touched, and what is asked of a robot there."""

from dataclasses import dataclass

import trimesh

from nerfnav.geometry.box import Box
from nerfnav.robots.state import RigidState

Point = tuple[float, float, float]


@dataclass(frozen=True)
class Task:
    """Fly from one place to another, at rest at both ends."""

    name: str
    """What users read."""
    start: Point
    """[m]"""
    goal: Point
    """[m]"""
    start_yaw: float = 0.0
    """Heading at the start [rad]."""
    goal_yaw: float = 0.0
    """Heading at the goal [rad]."""
    robot: str = "quadrotor"
    """Name of the robot that the task is for."""

    @property
    def start_state(self) -> RigidState:
        """The state at rest at the start."""
        return RigidState.at_rest(self.start, self.start_yaw)

    @property
    def goal_state(self) -> RigidState:
        """The state at rest at the goal."""
        return RigidState.at_rest(self.goal, self.goal_yaw)


@dataclass(frozen=True, eq=False)
class Scene:
    """Ground truth. Two scenes are the same only if they are the same object."""

    name: str
    """What users call it, as in `nerfnav plan NAME`."""
    title: str
    """What users read."""
    mesh: trimesh.Trimesh
    """What is seen: sRGB vertex colours, face colours or a UV texture, light and shadow included."""
    solids: tuple[trimesh.Trimesh, ...]
    """What is touched: watertight parts, which may overlap one another."""
    box: Box
    """Where a field of the scene lives and a robot may fly."""
    sky: tuple[float, float, float]
    """sRGB colour of a ray that hits nothing, in [0, 1]."""
    tasks: tuple[Task, ...]
    """Flights to try, the first of them the default."""
    voxel: float | None = None
    """Size of the voxels that suit a field of it [m]; None where the usual size does."""

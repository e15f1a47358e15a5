"""Task: a flight from one position to another in a scene. Imports no mesh library: start-up needs the tasks alone."""

from dataclasses import dataclass

from nerfnav.robots import RigidState

Point = tuple[float, float, float]


@dataclass(frozen=True)
class Task:
    """Fly from one place to another, at rest at both ends."""

    name: str
    """Title for users."""
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

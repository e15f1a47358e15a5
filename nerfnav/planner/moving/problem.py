"""Problem of a plan among moving obstacles: robot, limits, region and ends in a frame whose x points ahead.

The robot is a box that keeps its attitude. All coordinates are those of the frame: p_frame = axes p_world, with the
axes as rows.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from nerfnav.core.errors import InvalidInputError, require_positive
from nerfnav.obstacles import ObstacleSet

Vector = tuple[float, float, float]
Matrix = Float[np.ndarray, "3 3"]


@dataclass(frozen=True)
class MotionLimits:
    """Limits of a robot's motion, each axis on its own."""

    speed: float = 5.0
    """[m/s]"""
    acceleration: float = 20.0
    """[m/s^2]"""
    jerk: float = 100.0
    """[m/s^3]"""
    fall: float = 9.0
    """Largest downward acceleration [m/s^2]: at 9.81 a rotor's thrust is zero."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for a limit that is not above 0."""
        require_positive(speed=self.speed, acceleration=self.acceleration, jerk=self.jerk, fall=self.fall)


@dataclass(frozen=True)
class MovingConfig:
    """Settings of the search, of the smoothing, and of the comparison of plans."""

    layer_s: float = 0.25
    """Time between control points [s]."""
    parts: int = 6
    """Steps of a layer at which obstacles are placed, even; between them all moves in straight lines."""
    cell: float = 0.25
    """Largest cell of the search across [m]; where it finds no path, half of it."""
    blocked_m: float = 0.1
    """Distance from obstacles at which the search stays [m]."""
    near_m: float = 0.35
    """Distance from obstacles below which cells cost more [m]."""
    smooth_m: float = 0.08
    """Distance from obstacles that the smoothing keeps [m]."""
    margin_m: float = 0.02
    """Distance from obstacles that a plan must keep [m]."""
    speeds: tuple[float, ...] = (1.0, 0.94, 0.88, 0.8, 0.7, 0.55, 0.4, 0.25)
    """Speeds that are tried one after the other, as shares of the limit."""
    waits_s: tuple[float, ...] = (1.0, 2.0, 4.0, 8.0, 16.0)
    """Times at rest before it sets off that are tried after all speeds [s]."""
    sweeps: int = 30
    """Passes of the smoothing."""
    jerk_cost: float = 2e-4
    """Seconds of flight that a squared jerk of 1 m^2/s^6 over a second is worth."""
    better_by: float = 0.05
    """Share by which another plan must cost less than the present one to replace it."""
    latency_s: float = 0.05
    """Time that replanning may take [s]: the plan is kept until the first control point after it."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for settings that no search can have."""
        require_positive(layer_s=self.layer_s, cell=self.cell)
        if self.parts < 2 or self.parts % 2:
            raise InvalidInputError(f"parts is an even number from 2 on, not {self.parts}")
        if not self.speeds or not all(0 < share <= 1 for share in self.speeds):
            raise InvalidInputError(f"speeds are shares above 0 and at most 1, not {self.speeds}")


@dataclass(frozen=True)
class Steps:
    """Largest differences of neighbouring control points, so that no limit of motion is exceeded."""

    ahead: float
    """Along x [m]."""
    gain: float
    """Change of the difference along x, from one to the next [m]."""
    y: float
    """Along y [m]."""
    z: float
    """Along z [m]."""

    @classmethod
    def of(cls, limits: MotionLimits, layer_s: float) -> "Steps":
        """Steps for any order of steps to both sides: then the second difference is at most twice, and the third four
        times as large."""
        speed, acceleration = limits.speed * layer_s, limits.acceleration * layer_s**2
        jerk = limits.jerk * layer_s**3
        y = min(speed, acceleration / 2, jerk / 4)
        return cls(speed, min(acceleration, jerk / 2), y, min(y, limits.fall * layer_s**2 / 2))


@dataclass(frozen=True)
class MovingProblem:
    """From a start at rest to a goal at rest, in a frame whose x points ahead."""

    obstacles: ObstacleSet
    """Obstacles, whose motion is known; time 0 is the start."""
    start: Vector
    """[m]"""
    goal: Vector
    """[m]"""
    half_extents: Vector
    """Half edges of the box around the robot [m]."""
    lower: Vector
    """Smallest coordinates of its centre [m]; only y and z count."""
    upper: Vector
    """Largest coordinates of its centre [m]."""
    limits: MotionLimits = field(default_factory=MotionLimits)
    """Limits of its motion along the axes of the frame."""
    axes: Matrix = field(default_factory=lambda: np.eye(3))
    """Axes of the frame in the world, as rows."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for ends outside the region, and for a goal that lies behind."""
        numbers = (*self.start, *self.goal, *self.half_extents, *self.lower, *self.upper)
        if not all(map(math.isfinite, numbers)):
            raise InvalidInputError("start, goal, robot and region of a plan are finite numbers")
        for name, end in (("start", self.start), ("goal", self.goal)):
            if any(not low <= at <= high for low, at, high in zip(self.lower, end, self.upper, strict=True)):
                raise InvalidInputError(f"the {name} {end} is outside the region from {self.lower} to {self.upper}")
        if self.goal[0] < self.start[0]:
            raise InvalidInputError("the goal lies behind the start: turn the frame, so that its x points ahead")


def axes_towards(start: Vector, goal: Vector) -> Matrix:
    """Axes of the frame whose x points from start to goal, seen from above; z stays up."""
    across = np.array([goal[0] - start[0], goal[1] - start[1]])
    length = float(np.linalg.norm(across))
    x, y = across / length if length > 1e-9 else (1.0, 0.0)
    return np.array([[x, y, 0.0], [-y, x, 0.0], [0.0, 0.0, 1.0]])

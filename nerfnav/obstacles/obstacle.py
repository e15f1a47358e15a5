"""Obstacle: a shape with a pose, a motion, a colour and a name; and a set of them at a time."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import torch
from jaxtyping import Float

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import Box, so3
from nerfnav.obstacles.motions import STILL, Motion, Times, Vector
from nerfnav.obstacles.shapes import Distances, Points, Shape

if TYPE_CHECKING:
    import trimesh  # slow to import

MOST = 1000
"""Largest number of obstacles in a set."""
_AXES = np.eye(3)


@dataclass(frozen=True)
class Boxes:
    """Axis-aligned boxes around obstacles at several times, in a frame of the caller."""

    centers: Float[np.ndarray, "m k 3"]
    """Middle of each obstacle's box at each time [m]."""
    halves: Float[np.ndarray, "k 3"]
    """Half edges [m]."""


@dataclass(frozen=True)
class Obstacle:
    """Obstacle that stands or moves; its attitude stays."""

    name: str
    """Name for users."""
    shape: Shape
    """Solid in its own axes."""
    position: Vector
    """Place of its origin in the world at rest [m]; its motion is added."""
    rotation: Vector = (0.0, 0.0, 0.0)
    """Roll, pitch and yaw [rad]: turned about x, then y, then z of the world."""
    motion: Motion = field(default=STILL)
    """Offset from the position as a function of time."""
    color: Vector = (0.85, 0.45, 0.1)
    """sRGB, 0 to 1."""
    seen: bool = False
    """True: it is not announced to robots, which may see it."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for a pose that is not finite, and a colour outside 0 to 1."""
        if not all(map(math.isfinite, (*self.position, *self.rotation))):
            raise InvalidInputError(f"the position and rotation of {self.name} are finite numbers")
        if not all(0 <= part <= 1 for part in self.color):
            raise InvalidInputError(f"the colour of {self.name} is red, green, blue from 0 to 1, not {self.color}")

    @property
    def moves(self) -> bool:
        """Check for a motion; what a hand holds counts as moving."""
        return self.motion != STILL

    @cached_property
    def attitude(self) -> Float[np.ndarray, "3 3"]:
        """Rotation matrix from its own axes to the world."""
        return so3.from_roll_pitch_yaw(torch.tensor(self.rotation, dtype=torch.float64)).numpy()

    def place(self, times: Times) -> Float[np.ndarray, "m 3"]:
        """Place of its origin at times [s], in the world [m]."""
        return np.array(self.position) + self.motion.offset(np.asarray(times, float))

    def signed_distance(self, points: Points, time: float = 0.0) -> Distances:
        """Distance of world points from its surface at a time [s], in m; negative inside."""
        return self.shape.signed_distance((points - self.place(np.array([time]))[0]) @ self.attitude)

    def span(self, axes: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "2 3"]:
        """Smallest and largest coordinates along `axes` (rows, unit vectors) from its origin [m]."""
        own = axes @ self.attitude
        return np.stack([-self.shape.support(-own), self.shape.support(own)])

    def mesh(self, time: float = 0.0) -> "trimesh.Trimesh":
        """Closed mesh in the world at a time [s], in its colour."""
        import trimesh

        mesh = self.shape.mesh()
        mesh.vertices = np.asarray(mesh.vertices) @ self.attitude.T + self.place(np.array([time]))[0]
        if mesh.volume < 0:  # its faces look inwards
            mesh.invert()
        color = [*(round(255 * part) for part in self.color), 255]
        return trimesh.Trimesh(
            mesh.vertices, mesh.faces, process=False, vertex_colors=np.tile(color, (len(mesh.vertices), 1))
        )


@dataclass(frozen=True)
class ObstacleSet:
    """Obstacles together; at most MOST of them, each with a name of its own."""

    obstacles: tuple[Obstacle, ...]
    """The obstacles, in the order of the file."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for too many obstacles, and for two of one name."""
        if len(self.obstacles) > MOST:
            raise InvalidInputError(f"there are {len(self.obstacles)} obstacles, and at most {MOST} can be placed")
        names = [obstacle.name for obstacle in self.obstacles]
        doubled = sorted({name for name in names if names.count(name) > 1})
        if doubled:
            raise InvalidInputError(f"two obstacles are named {doubled[0]!r}: give each a name of its own")

    def signed_distance(self, points: Points, time: float = 0.0) -> Distances:
        """Distance of world points from the nearest obstacle at a time [s], in m; negative inside, infinite without.

        Inside where several overlap it is that of the one whose surface is farthest.
        """
        found = np.full(len(points), np.inf)
        for obstacle in self.obstacles:
            np.minimum(found, obstacle.signed_distance(points, time), out=found)
        return found

    def boxes(self, times: Times | Sequence[float], axes: Float[np.ndarray, "3 3"] = _AXES) -> Boxes:
        """Boxes around each obstacle at times [s], along `axes` (rows, unit vectors); the world's own by default."""
        clock = np.asarray(times, float)
        spans = np.array([obstacle.span(axes) for obstacle in self.obstacles]).reshape(-1, 2, 3)
        places = [obstacle.place(clock) @ axes.T for obstacle in self.obstacles]
        centers = np.stack(places, 1) if places else np.zeros((len(clock), 0, 3))
        return Boxes(centers + spans.mean(1), 0.5 * (spans[:, 1] - spans[:, 0]))

    def box(self, time: float = 0.0) -> Box:
        """Box around all of them at a time [s]. Raises InvalidInputError for an empty set."""
        if not self.obstacles:
            raise InvalidInputError("there is no box around no obstacles")
        boxes = self.boxes([time])
        lower, upper = boxes.centers[0] - boxes.halves, boxes.centers[0] + boxes.halves
        return Box.of(lower.min(0), upper.max(0))

    @property
    def speed_bound(self) -> float:
        """Speed that none of them exceeds [m/s]."""
        return max((obstacle.motion.speed_bound for obstacle in self.obstacles), default=0.0)

    @property
    def standing(self) -> tuple[Obstacle, ...]:
        """The obstacles that are part of a place: they are announced, and have no motion."""
        return tuple(obstacle for obstacle in self.obstacles if not (obstacle.moves or obstacle.seen))

    @property
    def moving(self) -> tuple[Obstacle, ...]:
        """The obstacles beside a place: they have a motion, or are not announced."""
        return tuple(obstacle for obstacle in self.obstacles if obstacle.moves or obstacle.seen)

    @property
    def has_seen(self) -> bool:
        """Check for an obstacle that is not announced."""
        return any(obstacle.seen for obstacle in self.obstacles)

    @property
    def announced(self) -> tuple[Obstacle, ...]:
        """The obstacles beside a place that are announced to robots."""
        return tuple(obstacle for obstacle in self.moving if not obstacle.seen)

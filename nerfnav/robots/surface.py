"""Surface of a body as corners, edges and faces, that distances to anything are taken from.

The point of a body nearest to something outside lies within a face, within an edge where faces meet at less than 180
degrees, or at a corner of such edges. Balls are corners with a radius, so that distances from them are exact.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

if TYPE_CHECKING:
    import trimesh  # slow to import, and most bodies are boxes

_FLAT = 1e-3
"""Angle between two faces [rad] below which they count as one plane."""


@dataclass(frozen=True, eq=False)
class BodySurface:
    """Surface of a body, in its axes [m]."""

    corners: Float[np.ndarray, "c 1 3"]
    """Corners, or middles of balls."""
    radii: Float[np.ndarray, " c"]
    """Radius of the ball around each corner; 0 for corners of faces."""
    edges: Float[np.ndarray, "e 2 3"]
    """Ends of each edge."""
    faces: Float[np.ndarray, "f 3 3"]
    """Corners of each triangle."""

    @classmethod
    def of_balls(cls, balls: Float[np.ndarray, "k 4"]) -> "BodySurface":
        """Make the surface of a union of balls: x, y, z and radius of each [m]."""
        return cls(balls[:, None, :3], balls[:, 3], np.zeros((0, 2, 3)), np.zeros((0, 3, 3)))

    @classmethod
    def of_box(cls, extents: tuple[float, float, float]) -> "BodySurface":
        """Make the surface of a box around the origin, with these edges [m]."""
        corner = np.array([[i >> 2 & 1, i >> 1 & 1, i & 1] for i in range(8)])
        place = (corner - 0.5) * extents
        edges = [(i, i | bit) for bit in (1, 2, 4) for i in range(8) if not i & bit]
        quads = [[i for i in range(8) if corner[i, axis] == side] for axis in range(3) for side in (0, 1)]
        faces = [face for a, b, c, d in quads for face in ((a, b, c), (b, c, d))]
        return cls(place[:, None], np.zeros(8), place[edges], place[faces])

    @classmethod
    def of_mesh(cls, mesh: "trimesh.Trimesh") -> "BodySurface":
        """Make the surface of a closed mesh [m]; edges in which it is flat or hollow are never nearest to anything."""
        sharp = mesh.face_adjacency_convex & (mesh.face_adjacency_angles > _FLAT)
        ends = mesh.face_adjacency_edges[sharp]
        vertices = np.asarray(mesh.vertices, float)
        corners = vertices[np.unique(ends)]
        return cls(corners[:, None], np.zeros(len(corners)), vertices[ends], np.asarray(mesh.triangles, float))

    def divided(self, size: float) -> "BodySurface":
        """Divide edges and faces until all of each is within `size` [m] of its middle."""
        edges, faces = (divide_until(each, radii_of, size) for each in (self.edges, self.faces))
        return BodySurface(self.corners, self.radii, edges, faces)


def radii_of(simplices: Float[np.ndarray, "n k 3"]) -> Float[np.ndarray, " n"]:
    """Compute the distance of the farthest corner from the middle of each corner, edge or face [m]."""
    return np.linalg.norm(simplices - simplices.mean(1, keepdims=True), axis=-1).max(1)


def split(simplices: Float[np.ndarray, "n k 3"]) -> Float[np.ndarray, "m k 3"]:
    """Split edges and faces in two, in the middle of the longest edge: first all first halves, then all second ones.

    A mesh whose faces are split until no edge is longer than some length keeps its corners on corners.
    """
    lengths = np.linalg.norm(np.roll(simplices, -1, 1) - simplices, axis=-1)
    turned = (lengths.argmax(1)[:, None] + np.arange(simplices.shape[1])) % simplices.shape[1]
    a, b, *rest = np.take_along_axis(simplices, turned[..., None], 1).swapaxes(0, 1)
    middle = 0.5 * (a + b)
    return np.concatenate([np.stack([a, middle, *rest], 1), np.stack([middle, b, *rest], 1)])


def longest_edges(faces: Float[np.ndarray, "f 3 3"]) -> Float[np.ndarray, " f"]:
    """Compute the length of the longest edge of each triangle [m]."""
    return np.linalg.norm(np.roll(faces, -1, 1) - faces, axis=-1).max(1)


def divide_until(
    simplices: Float[np.ndarray, "n k 3"], measure: Callable[[np.ndarray], np.ndarray], size: float
) -> Float[np.ndarray, "m k 3"]:
    """Split edges or faces until a measure of all of them is at most `size` [m]."""
    done = []
    while len(simplices):
        large = measure(simplices) > size
        done.append(simplices[~large])
        simplices = split(simplices[large])
    return np.concatenate([*done, simplices])

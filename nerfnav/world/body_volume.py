"""Body volume: a robot's body as a manifold for exact booleans with solids, and as cells for all other meshes."""

from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Float, Int
from manifold3d import Error, Manifold, Mesh64

from nerfnav.core.errors import InvalidInputError
from nerfnav.robots import Body
from nerfnav.world.triangle_index import TriangleIndex, Vector, boxes_touch_triangles


def manifold_of(vertices: Float[np.ndarray, "v 3"], faces: Int[np.ndarray, "f 3"]) -> Manifold | None:
    """The solid that triangles bound, seen counter-clockwise from outside; None where they bound no volume."""
    corners = np.ascontiguousarray(faces, np.uint64)
    manifold = Manifold(Mesh64(np.ascontiguousarray(vertices, np.float64), corners))
    return manifold if manifold.status() == Error.NoError and manifold.volume() > 0 else None


_CELLS_PER_EDGE, _FEWEST, _MOST_PER_EDGE = 8, 8, 256
"""Cells along each edge of the box around a body, least number of cells in it, and most along its longest edge."""
_PAIRS_AT_ONCE = 40_000


class BodyVolume:
    """The box of a body, or its own solid where it has one, in the body's axes."""

    def __init__(self, body: Body) -> None:
        """Cut the body into cells. Raises InvalidInputError for a solid that bounds no volume."""
        self.half: Vector = np.array(body.extents) / 2
        self.is_box = body.solid is None
        self.manifold = Manifold.cube(2 * self.half, center=True)
        counts = np.full(3, _CELLS_PER_EDGE)
        self.middles: Float[np.ndarray, "m 3"] = _middles(self.half, counts)
        if body.solid is not None:
            vertices, faces = np.asarray(body.solid.vertices), np.asarray(body.solid.faces)
            closed = manifold_of(vertices, faces) or manifold_of(vertices, faces[:, ::-1])
            if closed is None:
                raise InvalidInputError("the robot's body is no closed solid: close its mesh, or take its convex hull")
            self.manifold = closed
            self.middles, cells = self.middles[body.solid.contains(self.middles)], _CELLS_PER_EDGE
            while len(self.middles) < _FEWEST and cells < _MOST_PER_EDGE:  # arms between the cells: cut finer, in cubes
                cells *= 2
                counts = np.maximum(2, np.ceil(cells * self.half / self.half.max())).astype(int)
                grid = _middles(self.half, counts)
                self.middles = grid[body.solid.contains(grid)]
            if len(self.middles) == 0:
                raise InvalidInputError("the robot's body is too thin to be judged: give it more volume")
        self.cell_half: Vector = self.half / counts

    @property
    def cell_volume(self) -> float:
        """Volume of one cell, so that all of them make up the body [m^3]."""
        return float(self.manifold.volume()) / len(self.middles)

    def crossed(
        self, surfaces: TriangleIndex, rotation: Float[np.ndarray, "3 3"], center: Vector
    ) -> Bool[np.ndarray, " m"]:
        """Mark cells of the body at x_world = rotation x + center that a surface crosses."""
        crossed = np.zeros(len(self.middles), bool)
        corners = (surfaces.near(center, float(np.linalg.norm(self.half))) - center) @ rotation
        corners = corners[boxes_touch_triangles(corners, self.half)]
        for some in np.array_split(corners, 1 + len(corners) * len(self.middles) // _PAIRS_AT_ONCE):
            open_ = np.flatnonzero(~crossed)
            pairs = some[None] - self.middles[open_, None, None]
            touch = boxes_touch_triangles(pairs.reshape(-1, 3, 3), self.cell_half)
            crossed[open_] = touch.reshape(len(open_), len(some)).any(1)
        return crossed


def _middles(half: Vector, counts: Int[np.ndarray, "3"]) -> Float[np.ndarray, "m 3"]:
    """Place the middles of so many cells along each edge of a box with these half edges [m]."""
    x, y, z = ((np.arange(count) + 0.5) / count * 2 - 1 for count in counts)
    return np.stack(np.meshgrid(x, y, z), -1).reshape(-1, 3) * half


@lru_cache(maxsize=8)
def build_body_volume(body: Body) -> BodyVolume:
    """The body's volume, made once."""
    return BodyVolume(body)

"""Body of a robot: points to sample densities at, and a solid to judge against a mesh.

Solids are closed meshes, read, checked, and filled with points.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.robots.state import RigidState

if TYPE_CHECKING:
    import trimesh  # slow to import, and most bodies are boxes


_SMALLEST, _LARGEST = 0.005, 5.0
"""Longest edge of a body [m] below or above which its mesh is surely in other units."""
_MOST_POINTS = 5000
"""Body points from which on planning takes seconds."""


def solid_of(source: "trimesh.Trimesh | Path | str", spacing: float, hull: bool) -> "trimesh.Trimesh":
    """Make a closed mesh [m] of a mesh, a file, or the convex hull of either, around the middle of its bounding box.

    Raises InvalidInputError for what is no such mesh, is absurdly large, or has too many points `spacing` [m] apart.
    """
    mesh = _checked(read_mesh(source) if isinstance(source, Path | str) else source, spacing)
    mesh = (mesh.convex_hull if hull else mesh).copy()
    if not mesh.is_watertight:
        raise InvalidInputError("a body's mesh must be closed, or nothing is inside: close it, or take its hull")
    mesh.apply_translation(-mesh.bounds.mean(0))
    return mesh


def read_mesh(path: Path | str) -> "trimesh.Trimesh":
    """Read the mesh of a file, unchecked. Raises InvalidInputError for a file that is none."""
    import trimesh

    try:
        return trimesh.load_mesh(path)
    except Exception as error:  # readers raise anything for a broken file
        raise InvalidInputError(f"{path} cannot be read as a mesh: {error}") from error


def _checked(mesh: "trimesh.Trimesh", spacing: float) -> "trimesh.Trimesh":
    import trimesh

    if not isinstance(mesh, trimesh.Trimesh) or len(mesh.faces) == 0:
        raise InvalidInputError("a body's mesh must have triangles, and this one has none")
    if not np.isfinite(mesh.vertices).all():
        raise InvalidInputError("the corners of a body's mesh must be finite numbers")
    size = float(mesh.extents.max())
    if not _SMALLEST <= size <= _LARGEST:
        raise InvalidInputError(
            f"a body's mesh must be {_SMALLEST:g} to {_LARGEST:g} m long, not {size:g} m: is it in other units?"
        )
    if not spacing > 0:
        raise InvalidInputError(f"the spacing of body points must be above 0 m, not {spacing}")
    if float(np.prod(mesh.extents / spacing + 1)) > _MOST_POINTS:
        raise InvalidInputError(
            f"a body {size:g} m long with points {spacing:g} m apart would have more than {_MOST_POINTS} of them: "
            "take a larger spacing"
        )
    return mesh


def fill_with_points(mesh: "trimesh.Trimesh", spacing: float) -> np.ndarray:
    """Fill a mesh around the origin with points (b, 3) on its surface and inside, in a fixed order."""
    import trimesh

    corners, faces = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, spacing)[:2]
    # of the surface, the point nearest to each node of a grid; of the inside, the middles of cells, clear of flat faces
    counts = np.ceil(mesh.extents / spacing).astype(int)
    axes = [edge * ((np.arange(n) + 0.5) / n - 0.5) for edge, n in zip(mesh.extents, counts, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    surface = corners[np.unique(faces)]
    cell = np.round(surface / spacing).astype(int)
    nearness = np.linalg.norm(surface - cell * spacing, axis=-1)
    order = np.lexsort((nearness, *cell.T))
    _, first = np.unique(cell[order], axis=0, return_index=True)
    return np.concatenate([surface[order[first]], grid[mesh.contains(grid)]])


@dataclass(frozen=True)
class Body:
    """Body: a solid around its origin, and points that fill it."""

    extents: tuple[float, float, float]
    """Edge lengths along the body's x, y, z of the solid, or of the box around it [m]."""
    points_body: Float[Tensor, "b 3"]
    """Points of the body at which densities are taken [m]."""
    solid: "trimesh.Trimesh | None" = None
    """Its closed surface in the body's axes [m]; None: the whole box."""

    @classmethod
    def box(cls, extents: tuple[float, float, float], counts: tuple[int, int, int]) -> "Body":
        """Make a box filled with a regular grid of counts[0] x counts[1] x counts[2] points, faces included."""
        axes = [
            torch.linspace(-edge / 2, edge / 2, count) if count > 1 else torch.zeros(1)
            for edge, count in zip(extents, counts, strict=True)
        ]
        return cls(extents, torch.cartesian_prod(*axes))

    @classmethod
    def from_mesh(cls, source: "trimesh.Trimesh | Path | str", spacing: float = 0.02, *, hull: bool = False) -> "Body":
        """Make a body of any shape: a closed mesh [m], or a file of one, filled with points about `spacing` [m] apart.

        The middle of its bounding box becomes the body's origin; x is forward and z up. With `hull` the body is the
        mesh's convex hull, which any mesh has. Raises InvalidInputError for what is no such mesh, or absurdly large.
        """
        mesh = solid_of(source, spacing, hull)
        x, y, z = (float(edge) for edge in mesh.extents)
        return cls((x, y, z), torch.from_numpy(fill_with_points(mesh, spacing)).float(), mesh)

    def points_at(self, states: RigidState) -> Float[Tensor, "*batch b 3"]:
        """Compute the places of its points in the world [m], at states of batch shape (*batch)."""
        points_body = self.points_body.to(states.position)
        return points_body @ states.rotation.transpose(-1, -2) + states.position[..., None, :]

    def grown(self, margin: float, *, upright: bool = True) -> "Body":
        """Grow the body: every face of its box moves outwards by `margin` [m], and all else in proportion.

        Without `upright` top and bottom stay where they are.
        """
        rise = margin if upright else 0.0
        x, y, z = (edge + 2 * more for edge, more in zip(self.extents, (margin, margin, rise), strict=True))
        stretch = torch.tensor([x, y, z]) / torch.tensor(self.extents)
        solid = None if self.solid is None else self.solid.copy().apply_scale(stretch.tolist())
        return Body((x, y, z), self.points_body * stretch.to(self.points_body), solid)

    @property
    def radius(self) -> float:
        """Return half of the box's diagonal [m]: the body fits into this ball in every attitude."""
        return 0.5 * sum(edge * edge for edge in self.extents) ** 0.5

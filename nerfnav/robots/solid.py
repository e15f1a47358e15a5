"""Solids that bodies are made of: closed meshes, read, checked, and filled with points."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from nerfnav.errors import InvalidInputError

if TYPE_CHECKING:
    import trimesh  # slow to import, and most bodies are boxes

_SMALLEST, _LARGEST = 0.005, 5.0
"""Longest edge of a body [m] below or above which its mesh is surely in other units."""
_MOST_POINTS = 5000
"""Body points from which on planning takes seconds."""


def solid_of(source: "trimesh.Trimesh | Path | str", spacing: float, hull: bool) -> "trimesh.Trimesh":
    """A closed mesh [m], or that of a file, or the convex hull of either, around the middle of its bounding box.

    Raises InvalidInputError for what is no such mesh, is absurdly large, or has too many points `spacing` [m] apart.
    """
    mesh = _checked(_read(source) if isinstance(source, Path | str) else source, spacing)
    mesh = (mesh.convex_hull if hull else mesh).copy()
    if not mesh.is_watertight:
        raise InvalidInputError("a body's mesh must be closed, or nothing is inside: close it, or take its hull")
    mesh.apply_translation(-mesh.bounds.mean(0))
    return mesh


def _read(path: Path | str) -> "trimesh.Trimesh":
    import trimesh

    try:
        return trimesh.load_mesh(path)
    except (OSError, ValueError, NotImplementedError) as error:
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


def filling(mesh: "trimesh.Trimesh", spacing: float) -> np.ndarray:
    """Points (b, 3) on the surface and inside of a mesh around the origin, in a fixed order."""
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

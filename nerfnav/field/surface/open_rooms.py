"""Open rooms: of a roofed place, keep only the surfaces that cameras saw, so that nothing hides the rooms.

The backs of walls and ceilings were seen by no camera. They have no colours that mean anything, and from outside they
are all that is seen. Without them viewers show the rooms from any side, for they do not draw faces from behind.
"""

from typing import TYPE_CHECKING

import numpy as np
import torch
from jaxtyping import Bool, Float

from nerfnav.field.core.occupancy import SOLID_DENSITY
from nerfnav.field.models.grid_field import GridField

if TYPE_CHECKING:
    import trimesh

_NEAR = (0.5, 1.0, 1.5, 2.0)
"""Distances before and behind a surface at which free space is sought, in distances of the mesh's nodes."""
_ROOFED = 0.5
"""Share of the ground under unseen faces from which on a place counts as roofed."""


def open_rooms(field: GridField, mesh: "trimesh.Trimesh", spacing: float) -> "trimesh.Trimesh":
    """The mesh of a field, its nodes `spacing` [m] apart; of a roofed place, without the faces that no camera saw.

    A face was seen if space before it is proven free, and is fog if all space behind it is, too. As planners see it,
    which presumes that depth has proven what is free: pictures alone prove little before plain walls.
    """
    seen = np.asarray(_seen(field, mesh, spacing)[mesh.faces].any(1))
    if not _is_roofed(mesh, seen, spacing):
        return mesh
    kept = mesh.copy()
    kept.update_faces(seen)
    kept.remove_unreferenced_vertices()
    return kept


def _seen(field: GridField, mesh: "trimesh.Trimesh", spacing: float) -> Bool[np.ndarray, " n"]:
    """Mark the vertices that cameras saw."""
    vertices, normals = (torch.from_numpy(np.array(part)).float() for part in (mesh.vertices, mesh.vertex_normals))

    def free(share: float) -> Bool[torch.Tensor, " n"]:
        points = vertices + share * spacing * normals
        with torch.no_grad():
            return field.box.contains(points) & (field.planned.density(points) < SOLID_DENSITY)

    before, behind = (torch.stack([free(side * share) for share in _NEAR]) for side in (1, -1))
    return (before.any(0) & ~behind.all(0)).numpy()


def _is_roofed(mesh: "trimesh.Trimesh", seen: Bool[np.ndarray, " m"], spacing: float) -> bool:
    """Check that most of the ground that was seen lies under faces that were not."""
    upward = mesh.face_normals[:, 2] > 0
    ground, roof = (_highest(mesh, part & upward, spacing) for part in (seen, ~seen))
    there = np.isfinite(ground)
    return bool(there.any()) and float((roof > ground)[there].mean()) > _ROOFED


def _highest(mesh: "trimesh.Trimesh", faces: Bool[np.ndarray, " m"], spacing: float) -> Float[np.ndarray, "nx ny"]:
    """Height of the highest of some faces above each cell of a grid [m]; -inf where there are none."""
    lower, upper = mesh.bounds
    cells = (np.ceil((upper - lower)[:2] / (2 * spacing)).astype(int)) + 1
    middles = mesh.triangles_center[faces]
    x, y = ((middles[:, :2] - lower[:2]) / (2 * spacing)).astype(int).T
    heights = np.full(cells, -np.inf)
    np.maximum.at(heights, (x, y), middles[:, 2])
    return heights

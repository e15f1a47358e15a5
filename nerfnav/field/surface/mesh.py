"""Surface extraction: a coloured mesh for viewers and mesh-based planners, and surface points to fit planes to."""

from typing import TYPE_CHECKING

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.field.core.occupancy import SOLID_DENSITY
from nerfnav.field.core.protocol import Field, density_in_box
from nerfnav.geometry import node_positions, shape_for, spacing_of

if TYPE_CHECKING:
    import trimesh

_POINTS_AT_ONCE = 1 << 18


def _sample_density(field: Field, shape: tuple[int, int, int]) -> np.ndarray:
    """Densities [1/m] on the nodes of a regular grid."""
    points = node_positions(field.box, shape).reshape(-1, 3)
    parts = [density_in_box(field, part.double().numpy()) for part in points.split(_POINTS_AT_ONCE)]
    return np.concatenate(parts).reshape(shape).astype(np.float32)


def field_mesh(field: Field, spacing: float, level: float = 50.0) -> "trimesh.Trimesh":
    """The surface where the density is `level` [1/m], with vertex colours, closed at the box's border.

    Marching cubes on samples `spacing` [m] apart (Lorensen and Cline, 1987). An empty field gives an empty mesh.
    """
    # imported when meshes are made: both take long, and most fields are never a mesh
    import trimesh
    from skimage.measure import marching_cubes

    shape = shape_for(field.box, spacing)
    # the logarithm makes the exponential flank of a density linear: smoother surfaces
    density = np.log(np.maximum(_sample_density(field, shape), 1e-6) / level)
    if density.max() <= 0:
        return trimesh.Trimesh()
    closed = np.pad(density, 1, constant_values=min(-1.0, float(density.min())))
    spacings = spacing_of(field.box, shape).numpy()
    vertices, faces, normals, _ = marching_cubes(closed, 0.0, spacing=tuple(float(part) for part in spacings))
    vertices = vertices - spacings + field.box.lower.numpy()
    points = torch.from_numpy(np.clip(vertices, field.box.lower.numpy(), field.box.upper.numpy())).float()
    inward = torch.from_numpy(np.ascontiguousarray(normals)).float()
    colors = _surface_colors(field, points, inward, float(spacings.min()))
    return trimesh.Trimesh(vertices, faces[:, ::-1], vertex_colors=colors, process=False)


def _surface_colors(field: Field, points: torch.Tensor, outward: torch.Tensor, depth: float) -> np.ndarray:
    """sRGB bytes (n, 3): what is seen from outside, found a little below the surface, where density is high."""
    with torch.no_grad():
        parts = [
            field.radiance(point - 0.5 * depth * normal, -normal)
            for point, normal in zip(points.split(_POINTS_AT_ONCE), outward.split(_POINTS_AT_ONCE), strict=True)
        ]
    return (torch.cat(parts).clamp(0, 1) * 255).round().to(torch.uint8).numpy()


def surface_points(field: Field, spacing: float, towards: tuple[float, float, float]) -> Float[Tensor, "n 3"]:
    """Find the surface points in the direction of the axis that is nearest to `towards`, in steps of `spacing` [m]."""
    shape = shape_for(field.box, spacing)
    dense = torch.from_numpy(_sample_density(field, shape)) > SOLID_DENSITY
    axis = int(torch.tensor(towards).abs().argmax())
    sign = 1 if towards[axis] > 0 else -1
    step = torch.zeros(3)
    step[axis] = 0.5 * sign * float(spacing_of(field.box, shape)[axis])
    count = shape[axis] - 1
    inner, beyond = (0, 1) if sign > 0 else (1, 0)
    top = dense.narrow(axis, inner, count) & ~dense.narrow(axis, beyond, count)
    return node_positions(field.box, shape).narrow(axis, inner, count)[top] + step

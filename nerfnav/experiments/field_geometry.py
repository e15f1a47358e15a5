"""Geometry of a field: measure that it is opaque at surfaces and clear in free space, whatever its colours.

Surfaces. Points are drawn evenly over the area of the ground-truth mesh inside the field's box. Those count that at
least three of the capture's cameras see: the point lies in the picture, and a ray cast at the mesh from the camera
meets nothing in front of it. Along the three voxels of the surface's normal that are centred on such a point, the
optical depth is the integral of sigma: e^-1 of the light passes a depth of 1, a tenth of it a depth of 2.3.

Free space. Points are drawn evenly in the box. Those count that lie in no solid and more than three voxels from every
surface; the distance is taken to points on the mesh half a voxel apart. There sigma should be below 1 / m.
"""

from dataclasses import dataclass

import numpy as np
import scipy
import torch
import trimesh
from jaxtyping import Bool, Float
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.field import Field
from nerfnav.geometry import Camera, Pose
from nerfnav.world import RayCaster, Scene, Solid

_SAMPLES = 61
"""Densities along a normal."""
_VIEWS, _VOXELS = 3, 3.0
"""Cameras that must see a point of the surface; length of the piece of normal, and distance of free points from
surfaces [voxels]."""
_HALF_OPAQUE, _OPAQUE, _CLEAR = 1.0, 2.3, 1.0
"""Optical depths that stop 63 % and 90 % of the light, and the density below which space counts as free [1/m]."""
_MOST_SURFACE = 4_000_000
"""Points on the mesh to which distances are taken: at most."""


@dataclass(frozen=True)
class GeometryConfig:
    """Sample sizes of the measurement."""

    surface_points: int = 6000
    """Points drawn on the mesh."""
    free_points: int = 30_000
    """Points drawn in the box."""


@dataclass(frozen=True)
class GeometryReport:
    """Opacity of a field at the surfaces of a mesh and in free space."""

    voxel_m: float
    """Size of the voxels that lengths are counted in [m]."""
    surface_points: int
    """Points of the surface that enough cameras see."""
    surface_depth_1: float
    """Share of them with an optical depth of at least 1."""
    surface_depth_2_3: float
    """Share of them with an optical depth of at least 2.3."""
    free_points: int
    """Points far from all surfaces."""
    free_clear: float
    """Share of them with a density below 1 / m."""


def measure_geometry(
    field: Field, voxel: float, scene: Scene, camera: Camera, poses: Pose, config: GeometryConfig | None = None
) -> GeometryReport:
    """Compare a field of `voxel` [m] with the mesh that `camera` photographed from `poses` T_world_camera.

    Draws are the same every time. Raises InvalidInputError where no point of the mesh is seen, or none is free.
    """
    config = config or GeometryConfig()
    points, face = trimesh.sample.sample_surface(scene.mesh, config.surface_points, seed=0)[:2]
    normals = torch.from_numpy(scene.mesh.face_normals[face]).float()
    surface = torch.from_numpy(np.asarray(points)).float()
    counted = (views(scene.mesh, surface, camera, poses, 0.5 * voxel) >= _VIEWS) & field.box.contains(surface)
    free = draw_free_points(field, scene, config.free_points, _VOXELS * voxel, 0.5 * voxel)
    if not counted.any() or len(free) == 0:
        raise InvalidInputError(
            "the mesh cannot judge the field: no point of its surface in the field's box is seen from where the "
            "cameras stood, or none of the box is free; a mesh must be in the field's frame and scale"
        )
    depth = optical_depth(field, surface[counted], normals[counted], _VOXELS * voxel)
    return GeometryReport(
        voxel,
        len(depth),
        share_of(depth >= _HALF_OPAQUE),
        share_of(depth >= _OPAQUE),
        len(free),
        share_of(field.density(free) < _CLEAR),
    )


@torch.no_grad()
def optical_depth(
    field: Field, points: Float[Tensor, "n 3"], normals: Float[Tensor, "n 3"], length: float
) -> Float[Tensor, " n"]:
    """The integral of density over `length` [m] of each normal, centred on its point (midpoint rule)."""
    along = ((torch.arange(_SAMPLES) + 0.5) / _SAMPLES - 0.5) * length
    return field.density(points[:, None] + along[:, None] * normals[:, None]).mean(1) * length


def views(
    mesh: trimesh.Trimesh, points: Float[Tensor, "n 3"], camera: Camera, poses: Pose, tolerance: float
) -> Float[Tensor, " n"]:
    """Count the cameras at poses T_world_camera, batch shape (k,), that see each point of the mesh.

    Hits less than `tolerance` [m] before the point do not hide it.
    """
    caster = RayCaster(mesh)
    seen = torch.zeros(len(points))
    for index, eye in enumerate(poses.position):
        ray = points - eye
        _, inside = camera.project(poses[index], points)
        distance = ray[inside].norm(dim=-1)
        rays = (ray[inside] / distance[:, None]).numpy()
        hit = caster.first_hits(np.tile(eye.numpy(), (len(rays), 1)), np.ascontiguousarray(rays)).distance
        seen[inside] += (torch.from_numpy(hit) > distance - tolerance).float()
    return seen


def draw_free_points(
    field: Field, scene: Scene, count: int, distance: float, spacing: float
) -> Float[Tensor, "n 3"]:
    """Of `count` points [m] drawn in the field's box, always the same, those that are in no solid and further than
    `distance` [m] from points `spacing` [m] apart on the mesh."""
    drawn = torch.rand(count, 3, generator=torch.Generator().manual_seed(0))
    points = field.box.lower + drawn * field.box.size
    on_mesh = min(_MOST_SURFACE, max(1, round(scene.mesh.area / spacing**2)))
    surface = trimesh.sample.sample_surface(scene.mesh, on_mesh, seed=1)[0]
    queries = points.double().numpy()
    away, _ = scipy.spatial.KDTree(surface).query(queries, distance_upper_bound=distance)
    free = np.isinf(away)
    for mesh in scene.solids:
        free[free] = ~Solid(mesh).contains(queries[free])
    return points[torch.from_numpy(free)]


def share_of(true: Bool[Tensor, " n"]) -> float:
    """Share of the entries that are true."""
    return float(true.float().mean())

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
import torch
import trimesh
from jaxtyping import Bool, Float
from scipy.spatial import KDTree
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.field import Field
from nerfnav.geometry import Camera, Pose
from nerfnav.world import RayCaster, Scene, Solid

_SAMPLES = 61
"""Densities along a normal."""
_MOST_SURFACE = 4_000_000
"""Points on the mesh to which distances are taken: at most."""


@dataclass(frozen=True)
class GeometryConfig:
    """Sample sizes and thresholds of the measurement."""

    surface_points: int = 6000
    """Points drawn on the mesh."""
    free_points: int = 30_000
    """Points drawn in the box."""
    views: int = 3
    """Cameras that must see a point of the surface."""
    voxels: float = 3.0
    """Length of the piece of normal, and distance of free points from surfaces [voxels]."""
    half_opaque: float = 1.0
    """Optical depth that stops 63 % of the light."""
    opaque: float = 2.3
    """Optical depth that stops 90 % of the light."""
    clear: float = 1.0
    """Density below which space counts as free [1/m]."""


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
    seen = views(scene.mesh, surface, camera, poses, 0.5 * voxel) >= config.views
    counted = seen & field.box.contains(surface)
    drawn = torch.rand(config.free_points, 3, generator=torch.Generator().manual_seed(0))
    space = field.box.lower + drawn * field.box.size
    free = space[is_free(scene, space, config.voxels * voxel, 0.5 * voxel)]
    if not counted.any() or len(free) == 0:
        raise InvalidInputError(
            "the mesh cannot judge the field: no point of its surface in the field's box is seen from where the "
            "cameras stood, or none of the box is free; a mesh must be in the field's frame and scale"
        )
    depth = optical_depth(field, surface[counted], normals[counted], config.voxels * voxel)
    clear = field.density(free) < config.clear
    return GeometryReport(
        voxel,
        len(depth),
        _share(depth >= config.half_opaque),
        _share(depth >= config.opaque),
        len(free),
        _share(clear),
    )


@torch.no_grad()
def optical_depth(
    field: Field, points: Float[Tensor, "n 3"], normals: Float[Tensor, "n 3"], length: float
) -> Float[Tensor, " n"]:
    """The integral of density over `length` [m] of each normal, centred on its point (midpoint rule)."""
    along = ((torch.arange(_SAMPLES) + 0.5) / _SAMPLES - 0.5) * length
    density = field.density(points[:, None] + along[:, None] * normals[:, None])
    return density.mean(1) * length


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


def is_free(scene: Scene, points: Float[Tensor, "n 3"], distance: float, spacing: float) -> Bool[Tensor, " n"]:
    """Mask of points [m] that are in no solid and further than `distance` [m] from points `spacing` [m] apart on
    the mesh."""
    count = min(_MOST_SURFACE, max(1, round(scene.mesh.area / spacing**2)))
    surface = trimesh.sample.sample_surface(scene.mesh, count, seed=1)[0]
    queries = points.double().numpy()
    away, _ = KDTree(surface).query(queries, distance_upper_bound=distance)
    free = np.isinf(away)
    for mesh in scene.solids:
        free[free] = ~Solid(mesh).contains(queries[free])
    return torch.from_numpy(free)


def _share(true: Bool[Tensor, " n"]) -> float:
    return float(true.float().mean())

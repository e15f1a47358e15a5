"""Free-space accuracy: compare what planners take for free with the truth, which tells whether plans can be trusted.

Surface. Points of the true surface inside the field's box that at least one camera sees. With a mesh they are drawn
evenly over its area, and a ray cast at it says which cameras see them; with depth maps alone they are what held-out
pixels saw. Planners take a point for free where the density of the field that they plan in
(field/core/occupancy.py) is at most that of what counts as solid.

Free space. Points drawn evenly in the box that lie in no solid, farther than two voxels from every surface, and that
at least three cameras see; with depth maps alone, points on the way to what held-out pixels saw.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy
import torch
import trimesh
from jaxtyping import Bool, Float
from torch import Tensor

from nerfnav.experiments.field_geometry import draw_free_points, share_of, views
from nerfnav.field import SOLID_DENSITY, Field, FieldInfo, UnknownSpace, planning_field
from nerfnav.field.core.occupancy import unproven_shares
from nerfnav.geometry import Camera, Pose, PosedImages
from nerfnav.world import Scene

_SURFACE_VIEWS, _FREE_VIEWS, _VOXELS = 1, 3, 2.0
"""Cameras that must see a point of the surface, and a free point; distance of free points from surfaces [voxels]."""
_MOST_ENDS = 400_000
"""Points on surfaces that are taken from depth maps, at most."""


@dataclass(frozen=True)
class FreeSpaceConfig:
    """Number of test points."""

    surface_points: int = 6000
    """Points drawn on the surface."""
    free_points: int = 10_000
    """Points drawn in the box."""


@dataclass(frozen=True)
class FreeSpaceAccuracy:
    """Free-space accuracy: shares of true surface and of truly free space that planners take for free."""

    surface_taken_for_free: float | None
    """Share of the true surface; None where it is unknown."""
    free_taken_for_free: float | None
    """Share of truly free space; None likewise."""
    unproven_share: float | None
    """Share of the box that is neither proven free nor solid; None where that was never determined."""
    voxel_m: float
    """Size of the voxels that lengths are counted in [m]."""


def measure_unproven_share(field: Field, voxel: float) -> FreeSpaceAccuracy:
    """Measure the unproven share of a field of `voxel` [m] alone, without a ground truth."""
    unproven = unproven_shares(field)
    return FreeSpaceAccuracy(None, None, None if unproven is None else float(unproven.mean()), voxel)


def measure_free_space_on_mesh(
    field: Field, voxel: float, scene: Scene, camera: Camera, poses: Pose, config: FreeSpaceConfig | None = None
) -> FreeSpaceAccuracy:
    """Compare with the mesh that `camera` photographed from `poses` T_world_camera; draws are always the same.

    A figure is None where no point of its kind is found.
    """
    config = config or FreeSpaceConfig()
    drawn = trimesh.sample.sample_surface(scene.mesh, config.surface_points, seed=0)[0]
    surface = torch.from_numpy(np.asarray(drawn)).float()
    surface = surface[field.box.contains(surface)]
    surface = surface[views(scene.mesh, surface, camera, poses, 0.5 * voxel) >= _SURFACE_VIEWS]
    space = draw_free_points(field, scene, config.free_points, _VOXELS * voxel, 0.5 * voxel)
    space = space[views(scene.mesh, space, camera, poses, 0.0) >= _FREE_VIEWS]
    return _accuracy(field, voxel, surface, space)


def measure_free_space_on_depth(
    field: Field, voxel: float, held_out: PosedImages, others: PosedImages, config: FreeSpaceConfig | None = None
) -> FreeSpaceAccuracy:
    """Compare with held-out depth maps; `others` give further surfaces, and the views of each point."""
    config = config or FreeSpaceConfig()
    rays = [_measured_rays(photographs, field) for photographs in (held_out, others)]
    ends = torch.cat([origins + distance[:, None] * directions for origins, directions, distance in rays])
    origins, directions, distance = rays[0]
    surface = _some(origins + distance[:, None] * directions, config.surface_points)
    share = torch.rand(len(distance), generator=_same())
    space = _some(origins + (share * distance)[:, None] * directions, config.free_points)
    space = space[field.box.contains(space)]
    away, _ = scipy.spatial.KDTree(_some(ends, _MOST_ENDS).numpy()).query(space.numpy())
    space = space[torch.from_numpy(away > _VOXELS * voxel)]
    space = space[_looks_past(others, space) >= _FREE_VIEWS]
    return _accuracy(field, voxel, surface[field.box.contains(surface)], space)


@torch.no_grad()
def taken_for_free(field: Field, points: Float[Tensor, "n 3"]) -> Bool[Tensor, " n"]:
    """Mark points [m] of a field that planners take for free."""
    return planning_field(field, UnknownSpace.OCCUPIED).density(points) <= SOLID_DENSITY


def describe_free_space_accuracy(accuracy: FreeSpaceAccuracy) -> str:
    """Describe the figures in sentences for the user."""
    parts = []
    if accuracy.surface_taken_for_free is not None:
        parts.append(f"planners take {accuracy.surface_taken_for_free:.1%} of the true surface for free")
    if accuracy.free_taken_for_free is not None:
        parts.append(f"{accuracy.free_taken_for_free:.1%} of the space that is free")
    if accuracy.unproven_share is None:
        proof = "nothing proves what is free here: plans trust the field alone"
    else:
        proof = f"{accuracy.unproven_share:.0%} of the box is unproven and counts as solid"
    return "; ".join([" and ".join(parts), proof] if parts else [proof])


def note_free_space(info: FieldInfo, accuracy: FreeSpaceAccuracy) -> FieldInfo:
    """Note the accuracy in the info of a field."""
    return replace(
        info,
        surface_taken_for_free=accuracy.surface_taken_for_free,
        free_taken_for_free=accuracy.free_taken_for_free,
        unproven_share=accuracy.unproven_share,
    )


def _accuracy(
    field: Field, voxel: float, surface: Float[Tensor, "n 3"], space: Float[Tensor, "m 3"]
) -> FreeSpaceAccuracy:
    shares = [share_of(taken_for_free(field, points)) if len(points) else None for points in (surface, space)]
    return FreeSpaceAccuracy(shares[0], shares[1], measure_unproven_share(field, voxel).unproven_share, voxel)


def _measured_rays(
    photographs: PosedImages, field: Field
) -> tuple[Float[Tensor, "n 3"], Float[Tensor, "n 3"], Float[Tensor, " n"]]:
    """Origins, directions and depths [m] of rays that met something in the box, from every picture."""
    assert photographs.depth is not None
    rays = [photographs.depth_camera.rays(photographs.poses[index]) for index in range(len(photographs))]
    origins, directions = (torch.cat(parts) for parts in zip(*rays, strict=True))
    distance = photographs.depth.reshape(-1)
    met = (distance > 0) & distance.isfinite()
    met[met.clone()] &= field.box.contains(origins[met] + distance[met, None] * directions[met])
    return origins[met], directions[met], distance[met]


def _looks_past(photographs: PosedImages, points: Float[Tensor, "n 3"]) -> Float[Tensor, " n"]:
    """Number of depth maps that end behind each point."""
    assert photographs.depth is not None
    camera, seen = photographs.depth_camera, torch.zeros(len(points))
    for index, depth in enumerate(photographs.depth):
        uv, inside = camera.project(photographs.poses[index], points)
        u, v = uv[inside].long().unbind(-1)
        seen[inside] += (depth[v, u] > (points[inside] - photographs.poses.position[index]).norm(dim=-1)).float()
    return seen


def _some(points: Float[Tensor, "n 3"], most: int) -> Float[Tensor, "m 3"]:
    return points[torch.randperm(len(points), generator=_same())[:most]]


def _same() -> torch.Generator:
    return torch.Generator().manual_seed(0)

"""Jacobian of ray colours by the camera's pose: the measurement derivative that pose filters need.

A camera's motion is (d(centre), d(turn)): its centre moves by d(centre) [m], and it turns by d(turn) [rad] about its
centre, both in the world's axes. A ray's origin o and direction d then change by

    do = d(centre),   dd = d(turn) x d
"""

from typing import Protocol, runtime_checkable

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.field.core.protocol import Field
from nerfnav.field.kernels.pose_descent import probe
from nerfnav.field.kernels.shells import Shells
from nerfnav.field.render.volume_rendering import Rendering, render_rays

Rays = Float[Tensor, "n 3"]
Colors = Float[Tensor, "n 3"]
Jacobian = Float[Tensor, "n 3 6"]


RayGrid = tuple[
    np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray,
    np.float32, np.ndarray, Shells, np.float32, np.float32,
]  # fmt: skip
"""Argument of kernels that march rays through a dense grid; a plain tuple, as parallel kernels take no other record.

Values (nx, ny, nz, 4), leaps (see kernels/pose_descent.py), lower corner [m], nodes per metre, table of light (see
kernels/light.py), distance of samples [m], background (3), shells around; least raw density that counts, and light
below which a ray ends."""


def get_ray_grid(field: Field) -> RayGrid | None:
    """The grid on which kernels follow whole descents of cameras; None where a field has none."""
    return getattr(field, "ray_grid", None)


def probe_rays(field: Field, origins: Rays, directions: Rays) -> Rendering | None:
    """Render rays (origins [m], unit directions) with the kernel of pose descents; None without a ray grid."""
    if (grid := get_ray_grid(field)) is None:
        return None
    rendered = probe(grid, *(np.ascontiguousarray(rays.numpy(), np.float32) for rays in (origins, directions)))
    return Rendering(*(torch.from_numpy(part) for part in rendered))


@runtime_checkable
class FastJacobian(Protocol):
    """A field that has colours and their derivatives faster than autograd."""

    def colors_and_jacobian(self, origins: Rays, directions: Rays) -> tuple[Colors, Jacobian]:
        """Colours and Jacobians, as the function of this name gives them."""
        ...


def colors_and_jacobian(field: Field, origins: Rays, directions: Rays) -> tuple[Colors, Jacobian]:
    """Colours of rays (origins [m], unit directions) from one camera, and their derivatives by its motion.

    The first three columns are by d(centre) [1/m], the others by d(turn) [1/rad]. Distances of samples do not move.
    """
    if isinstance(field, FastJacobian):
        return field.colors_and_jacobian(origins, directions)
    return jacobian_by_autograd(field, origins, directions)


def jacobian_by_autograd(field: Field, origins: Rays, directions: Rays) -> tuple[Colors, Jacobian]:
    """The same for any field, by automatic differentiation of the reference renderer."""
    origins, directions = (rays.detach().requires_grad_() for rays in (origins, directions))
    with torch.enable_grad():
        color = render_rays(field, origins, directions).color
        rows = [
            torch.autograd.grad(color[:, channel].sum(), (origins, directions), retain_graph=channel < 2)
            for channel in range(3)
        ]
    by_origin, by_direction = (torch.stack(parts, 1) for parts in zip(*rows, strict=True))
    turned = torch.linalg.cross(directions.detach()[:, None].expand_as(by_direction), by_direction)
    return color.detach(), torch.cat([by_origin, turned], -1)

"""Voxel field, the default: raw density and colour on a dense grid, trilinear between the nodes.

    rho(p) = scale * softplus(raw(p))      c(p) = rgb(p), the same from all directions

(direct voxel grid optimisation: Sun, Sun, Chen, CVPR 2022, with the activation after the interpolation, so that a
surface can be sharper than a voxel). Empty space is exactly empty: its nodes hold `EMPTY_RAW`.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from nerfnav.field.core.occupancy import DENSITY_SCALE, EMPTY_RAW, Occupancy
from nerfnav.field.core.protocol import Points
from nerfnav.field.kernels import pose_descent
from nerfnav.field.kernels.cells import BLOCK_SHIFT, NEGLIGIBLE_RAW
from nerfnav.field.kernels.light import DIM, STOPPED, faint_raw, light_table
from nerfnav.field.kernels.pose_descent import leaps_over
from nerfnav.field.kernels.shells import Shells, paired_shells
from nerfnav.field.models.grid_field import GridField, KernelGrid
from nerfnav.field.render.jacobian import RayGrid
from nerfnav.geometry import trilinear


@dataclass(frozen=True)
class VoxelField(GridField):
    """A radiance field on a regular grid that keeps all its nodes (nx, ny, nz); for mostly empty places see BrickField.
    """

    @property
    def shape(self) -> tuple[int, int, int]:
        """Numbers of nodes along x, y, z."""
        nx, ny, nz, _ = self.values.shape
        return nx, ny, nz

    @cached_property
    def occupied(self) -> Bool[Tensor, "bx by bz"]:
        """Blocks of 4 x 4 x 4 cells that hold any density."""
        return occupied_blocks(self.values[..., 0], EMPTY_RAW + 1)

    def between_nodes(self, points: Points, channels: slice) -> Float[Tensor, "*batch c"]:
        """Interpolate between the nodes of the grid (see GridField)."""
        return trilinear(self.values[..., channels], self.box, points)

    @cached_property
    def unknown(self) -> Bool[Tensor, "nx ny nz"] | None:
        """Unproven nodes; None where occupancy was never determined."""
        return None if self.evidence is None else self.evidence == Occupancy.UNPROVEN

    @property
    def unproven_by_height(self) -> Float[Tensor, " nz"] | None:
        """Share of unproven nodes at each height (see GridField)."""
        return None if self.unknown is None else self.unknown.float().mean((0, 1))

    @cached_property
    def kernel_grid(self) -> KernelGrid:
        """First arguments of all kernels (see GridField)."""
        per_meter = (1 / self.spacing).cpu().numpy().astype(np.float32)
        lower = self.box.lower.cpu().numpy().astype(np.float32)
        return self.values.detach().cpu().numpy(), self.occupied.cpu().numpy().astype(np.uint8), lower, per_meter

    def _seen_with_jacobian(self, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See GridField; by the kernel that leaps over empty cells."""
        return pose_descent.colors_and_jacobian(self.exact_ray_grid, origins, directions)

    @cached_property
    def exact_ray_grid(self) -> RayGrid:
        """Ray grid for colours and Jacobians, without approximations."""
        return self._sight(self._leaps, self._outer, NEGLIGIBLE_RAW, STOPPED)

    @cached_property
    def ray_grid(self) -> RayGrid:
        """The same for descents of poses, without what is faint (see kernels/pose_descent.py)."""
        least = faint_raw(DENSITY_SCALE, self.step)
        return self._sight(leaps_over(self._raw, least), paired_shells(self._outer_values), least, DIM)

    def _sight(self, leaps: np.ndarray, outer: Shells, least: np.float32, stopped: np.float32) -> RayGrid:
        values, _, lower, per_meter = self.kernel_grid
        background = self.background.cpu().numpy().astype(np.float32)
        step = np.float32(self.step)
        return values, leaps, lower, per_meter, self._light, step, background, outer, least, stopped

    @cached_property
    def _light(self) -> np.ndarray:
        return light_table(DENSITY_SCALE, self.step)

    @cached_property
    def density_grid(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float, np.ndarray, np.ndarray]:
        """Arguments of the planner's kernels: raw densities, leaps, lower, nodes per metre, scale, corners of the box.

        Raw densities without the colours between them: a plan needs many places, and memory bandwidth limits it.
        """
        _, _, lower, per_meter = self.kernel_grid
        first, last = (edge.double().cpu().numpy() for edge in (self.box.lower, self.box.upper))
        return self._raw[..., None], self._leaps, lower, per_meter, DENSITY_SCALE, first, last

    @cached_property
    def _leaps(self) -> np.ndarray:
        return leaps_over(self._raw, NEGLIGIBLE_RAW)

    @cached_property
    def _raw(self) -> np.ndarray:
        return np.ascontiguousarray(self.kernel_grid[0][..., 0])

def occupied_blocks(
    raw: Float[Tensor, "nx ny nz"], threshold: float, shift: int = BLOCK_SHIFT
) -> Bool[Tensor, "bx by bz"]:
    """Blocks of 2^shift cells to a side with a node, borders included, whose raw density is above the threshold."""
    side = 1 << shift
    blocks = [-(-count // side) for count in raw.shape]
    padding = [part for count, size in zip(reversed(blocks), reversed(raw.shape), strict=True)
               for part in (0, count * side + 1 - size)]  # fmt: skip
    padded = torch.nn.functional.pad(raw[None, None], padding, value=EMPTY_RAW)
    return torch.nn.functional.max_pool3d(padded, side + 1, side)[0, 0] > threshold


"""The default field: raw density and colour on a grid, trilinear between the nodes.

    rho(p) = scale * softplus(raw(p))      c(p) = rgb(p), the same from all directions

(direct voxel grid optimisation: Sun, Sun, Chen, CVPR 2022, with the activation after the interpolation, so that a
surface can be sharper than a voxel). Empty space is exactly empty: its nodes hold `EMPTY_RAW`.
"""

from dataclasses import dataclass, replace
from dataclasses import field as dataclass_field
from functools import cached_property

import numpy as np
import torch
from jaxtyping import Bool, Float, UInt8
from torch import Tensor

from nerfnav.compiled import default_threads, threads
from nerfnav.field.evidence import DENSITY_SCALE, EMPTY_RAW, State, planned_raw
from nerfnav.field.field import Points, RaySamples, uniform_samples
from nerfnav.field.info import FieldInfo
from nerfnav.field.jacobian import SightGrid, jacobian_by_autograd
from nerfnav.field.kernels import jacobian, march
from nerfnav.field.kernels import points as point_kernels
from nerfnav.field.kernels.cells import BLOCK_SHIFT, NEGLIGIBLE_RAW
from nerfnav.field.kernels.leaps import leaps_over
from nerfnav.field.render import Rendering, render_rays
from nerfnav.field.surroundings import Backdrop, Surroundings
from nerfnav.geometry.box import Box
from nerfnav.geometry.grid import spacing_of, trilinear

_LEAST_DENSITY = 0.01  # [1/m] of samples that are kept: 10 cm of what is left out change a colour by 0.1 %


@dataclass(frozen=True)
class VoxelField:
    """A radiance field on a regular grid of nodes."""

    box: Box
    """Where the field is defined; nodes stand on its borders."""
    values: Float[Tensor, "nx ny nz 4"]
    """Raw density, red, green, blue of each node; colours in [0, 1]."""
    background: Float[Tensor, "3"]
    """Colour of a ray that nothing stops."""
    info: FieldInfo = dataclass_field(default_factory=FieldInfo)
    """Where the field comes from and how good it is."""
    outside: Surroundings | None = None
    """What stands around the box; None where rays that leave it see the background."""
    evidence: UInt8[Tensor, "nx ny nz"] | None = None
    """What is proven of each node (see field/evidence.py); None where that was never asked."""

    @property
    def shape(self) -> tuple[int, int, int]:
        """Numbers of nodes along x, y, z."""
        nx, ny, nz, _ = self.values.shape
        return nx, ny, nz

    @cached_property
    def spacing(self) -> Float[Tensor, "3"]:
        """Distance of neighbouring nodes along x, y, z [m]."""
        return spacing_of(self.box, self.shape)

    @property
    def step(self) -> float:
        """Distance of samples along rays [m]: half a voxel."""
        return 0.5 * float(self.spacing.min())

    @cached_property
    def occupied(self) -> Bool[Tensor, "bx by bz"]:
        """Which blocks of 4 x 4 x 4 cells hold any density."""
        return occupied_blocks(self.values[..., 0], float(NEGLIGIBLE_RAW))

    def to(self, device: torch.device | str) -> "VoxelField":
        """The same field with its tensors on a device; away from the CPU, torch does what kernels do here."""
        return replace(
            self,
            box=self.box.to(device),
            values=self.values.to(device),
            background=self.background.to(device),
            outside=None if self.outside is None else Surroundings(self.outside.values.to(device)),
            evidence=None if self.evidence is None else self.evidence.to(device),
        )

    def density(self, points: Points) -> Float[Tensor, "*batch"]:
        """rho at world points [1/m], differentiable twice; 0 outside the box."""
        raw = trilinear(self.values[..., :1], self.box, points)[..., 0]
        density = DENSITY_SCALE * torch.nn.functional.softplus(raw)
        return torch.where(self.box.contains(points), density, torch.zeros_like(density))

    def radiance(self, points: Points, directions: Points) -> Points:
        """Colour in [0, 1] at world points [m]; `directions` do not matter."""
        return trilinear(self.values[..., 1:], self.box, points)

    def samples(self, origins: Float[Tensor, "n 3"], directions: Float[Tensor, "n 3"]) -> RaySamples:
        """The samples, every half voxel, that have density and are not hidden behind others."""
        if self.values.device.type != "cpu":
            return uniform_samples(self.box, origins, directions, self.step)
        rays = (_flat(origins), _flat(directions))
        capacity = 64
        while True:
            with threads(default_threads()):
                distances, counts = march.significant_samples(
                    *self.kernel_grid, *rays, np.float32(DENSITY_SCALE), np.float32(self.step),
                    np.float32(_LEAST_DENSITY), capacity,
                )  # fmt: skip
            longest = max(1, int(counts.max(initial=0)))
            if longest <= capacity:
                break
            capacity = longest
        mask = torch.arange(longest) < torch.from_numpy(counts)[:, None]
        return RaySamples(torch.from_numpy(distances[:, :longest].copy()).to(origins), mask, self.step)

    def backdrop(self, origins: Float[Tensor, "n 3"], directions: Float[Tensor, "n 3"]) -> Backdrop | None:
        """What rays see of the surroundings, in torch; None where the field has none."""
        return None if self.outside is None else self.outside.backdrop(self.box, origins, directions)

    def density_and_gradient(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """rho (n) [1/m] and its gradient (n, 3) [1/m^2] at world points (n, 3) [m], in float64, compiled."""
        density, gradient = np.empty(len(points)), np.empty((len(points), 3))
        point_kernels.density_and_gradient(*self.kernel_grid, DENSITY_SCALE, points, density, gradient)
        return density, gradient

    def render_rays(self, origins: Float[Tensor, "n 3"], directions: Float[Tensor, "n 3"]) -> Rendering:
        """Colours, opacities and depths by the compiled kernel, or in torch on another device; no gradients."""
        if (device := self.values.device).type != "cpu":
            with torch.no_grad():
                return render_rays(self, origins.to(device), directions.to(device))
        with threads(default_threads()):
            parts = march.render(
                *self.kernel_grid, _flat(origins), _flat(directions), np.float32(DENSITY_SCALE), np.float32(self.step),
                self.background.cpu().numpy(), self._outer,
            )  # fmt: skip
        color, opacity, depth = (torch.from_numpy(part) for part in parts)
        return Rendering(color, opacity, depth)

    def colors_and_jacobian(
        self, origins: Float[Tensor, "n 3"], directions: Float[Tensor, "n 3"]
    ) -> tuple[Float[Tensor, "n 3"], Float[Tensor, "n 3 6"]]:
        """Colours of rays and their derivatives by the camera's motion (see field/jacobian.py), compiled.

        Where there are surroundings, the kernel does not know them, and torch differentiates.
        """
        if self.outside is not None:
            return jacobian_by_autograd(self, origins, directions)
        colors, jacobians = jacobian.colors_and_jacobian(self._sight, _flat(origins), _flat(directions))
        return torch.from_numpy(colors), torch.from_numpy(jacobians)

    @cached_property
    def unknown(self) -> Bool[Tensor, "nx ny nz"] | None:
        """Nodes that are not proven to be anything; None where that was never asked."""
        return None if self.evidence is None else self.evidence == State.UNPROVEN

    @cached_property
    def planned(self) -> "VoxelField":
        """The field as planners take it: free where that is proven, solid where nothing is; made once."""
        return self._planned(False)

    @cached_property
    def planned_as_it_says(self) -> "VoxelField":
        """The same with unproven nodes as they are; made once."""
        return self._planned(True)

    def _planned(self, unproven_is_free: bool) -> "VoxelField":
        if self.evidence is None:
            return self
        values = self.values.clone()
        values[..., 0] = planned_raw(values[..., 0], self.evidence, unproven_is_free)
        return replace(self, values=values)

    @cached_property
    def kernel_grid(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """What all kernels ask for first: values, occupied, lower, nodes per metre."""
        per_meter = (1 / self.spacing).cpu().numpy().astype(np.float32)
        lower = self.box.lower.cpu().numpy().astype(np.float32)
        return self.values.detach().cpu().numpy(), self.occupied.cpu().numpy().astype(np.uint8), lower, per_meter

    @property
    def sight_grid(self) -> SightGrid | None:
        """What kernels need that follow rays with their derivatives; None where there are surroundings."""
        return self._sight if self.outside is None else None

    @cached_property
    def density_grid(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float, np.ndarray, np.ndarray]:
        """What the planner's kernels need: values, leaps, lower, nodes per metre, scale, corners of the box."""
        values, _, lower, per_meter = self.kernel_grid
        first, last = (edge.double().cpu().numpy() for edge in (self.box.lower, self.box.upper))
        return values, self._leaps, lower, per_meter, DENSITY_SCALE, first, last

    @cached_property
    def _leaps(self) -> np.ndarray:
        return leaps_over(np.ascontiguousarray(self.kernel_grid[0][..., 0]), NEGLIGIBLE_RAW)

    @cached_property
    def _sight(self) -> SightGrid:
        values, _, lower, per_meter = self.kernel_grid
        leaps = self._leaps
        table = jacobian.light_table(DENSITY_SCALE, self.step)
        background = self.background.cpu().numpy().astype(np.float32)
        return values, leaps, lower, per_meter, table, np.float32(self.step), background

    @cached_property
    def _outer(self) -> np.ndarray:
        """Values around the box as kernels ask for them: no nodes where there is nothing."""
        return np.zeros((0, 0, 0, 4), np.float32) if self.outside is None else _flat(self.outside.values)


def occupied_blocks(raw: Float[Tensor, "nx ny nz"], threshold: float) -> Bool[Tensor, "bx by bz"]:
    """Blocks of cells with a node, borders included, whose raw density is above the threshold."""
    side = 1 << BLOCK_SHIFT
    blocks = [-(-count // side) for count in raw.shape]
    padding = [part for count, size in zip(reversed(blocks), reversed(raw.shape), strict=True)
               for part in (0, count * side + 1 - size)]  # fmt: skip
    padded = torch.nn.functional.pad(raw[None, None], padding, value=EMPTY_RAW)
    return torch.nn.functional.max_pool3d(padded, side + 1, side)[0, 0] > threshold


def _flat(tensor: Tensor) -> np.ndarray:
    return np.ascontiguousarray(tensor.detach().cpu().numpy(), dtype=np.float32)

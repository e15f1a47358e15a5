"""Grid field: the base of all fields on a regular grid of nodes, however they keep the nodes (voxel.py, bricks.py).

    rho(p) = scale * softplus(raw(p))      c(p) = rgb(p), the same from all directions

raw and rgb are trilinear between the nodes.
"""

import math
import weakref
from abc import ABC, abstractmethod
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import TypeVar

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from nerfnav.core.jit import default_threads, threads
from nerfnav.core.memory import require_memory
from nerfnav.field.core.info import FieldInfo
from nerfnav.field.core.occupancy import DENSITY_SCALE, UnknownSpace, planning_raw, solid_density
from nerfnav.field.core.protocol import Points, RaySamples, uniform_samples
from nerfnav.field.kernels import cells, jacobian, march
from nerfnav.field.kernels.shells import Shells, whole_shells
from nerfnav.field.render.surroundings import Backdrop, Surroundings
from nerfnav.field.render.volume_rendering import Rendering, render_rays
from nerfnav.geometry import Box, spacing_of

_LEAST_DENSITY = 0.01  # [1/m] of samples that are kept: 10 cm of what is left out change a colour by 0.1 %

_WORTH_THREADS = 20_000  # points that take longer than waking the threads up

_AT_ONCE = 1 << 17
"""Nodes whose states are processed together: intermediate arrays stay in the processor's cache, which in a hall is ten
times faster than memory that is taken for it and given back."""

G = TypeVar("G", bound="GridField")
KernelGrid = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True, eq=False)
class Origin:
    """Field from which another one differs in a box alone: what was derived of it is derived anew there alone."""

    reference: "weakref.ref[GridField]"
    """The field, for as long as others need it."""
    box: Box
    """Part in which they differ [m]."""


def origin_of(field: object) -> "tuple[GridField, Box] | None":
    """Return the field from which this one differs in a box alone, and the box; None where there is none any more."""
    origin = field.origin if isinstance(field, GridField) else None
    before = None if origin is None else origin.reference()
    return None if origin is None or before is None else (before, origin.box)


@dataclass(frozen=True)
class GridField(ABC):
    """A radiance field between the nodes of a regular grid."""

    box: Box
    """Domain of the field; nodes stand on its borders."""
    values: Float[Tensor, "*nodes 4"]
    """Raw density, red, green, blue of each node that is kept; colours in [0, 1]."""
    background: Float[Tensor, "3"]
    """Colour of a ray that nothing stops."""
    info: FieldInfo = field(default_factory=FieldInfo)
    """Origin and quality of the field."""
    outside: Surroundings | None = None
    """Surroundings of the box; None where rays that leave it see the background."""
    evidence: UInt8[Tensor, "*nodes"] | None = None
    """Occupancy of each node that is kept (see field/core/occupancy.py); None where it was never determined."""
    origin: Origin | None = field(default=None, init=False, compare=False, repr=False)
    """Field from which this one differs in a box alone; None where that is not known. It is no argument: a copy with
    other values does not have it."""

    @property
    @abstractmethod
    def shape(self) -> tuple[int, int, int]:
        """Numbers of nodes along x, y, z."""

    @cached_property
    @abstractmethod
    def kernel_grid(self) -> KernelGrid:
        """First arguments of all kernels: values, occupied, lower, nodes per metre (see kernels/cells.py)."""

    @property
    @abstractmethod
    def unproven_by_height(self) -> Float[Tensor, " nz"] | None:
        """Share of unproven nodes at each height; None where occupancy was never determined."""

    @abstractmethod
    def between_nodes(self, points: Points, channels: slice) -> Float[Tensor, "*batch c"]:
        """Some of raw density, red, green, blue at world points [m], in torch, differentiable twice."""

    @cached_property
    def planned(self) -> "GridField":
        """The field as planners take it: empty where that is proven, solid where nothing is; made once."""
        return self._planned(UnknownSpace.OCCUPIED)

    @cached_property
    def _planned_as_it_says(self) -> "GridField":
        return self._planned(UnknownSpace.FREE)

    def planning_view(self, unknown: UnknownSpace) -> "GridField":
        """Return the field as planners take it (see core/occupancy.py)."""
        return self.planned if unknown is UnknownSpace.OCCUPIED else self._planned_as_it_says

    def _planned(self, unknown: UnknownSpace) -> "GridField":
        if self.evidence is None:
            return self
        require_memory(1.0 * self.values.nbytes, "the field as planners take it", "make one with a larger --voxel")
        before = origin_of(self)
        if before is not None:
            return self._planned_from(*before, unknown)
        values = self.values.clone()
        layers = max(1, _AT_ONCE // max(1, math.prod(values.shape[1:-1])))
        for part, states in zip(values.split(layers), self.evidence.split(layers), strict=True):
            part[..., 0] = planning_raw(part[..., 0], states, unknown)
        return replace(self, values=values)

    def _planned_from(self, last: "GridField", box: Box, unknown: UnknownSpace) -> "GridField":
        """The field as planners take it, where it differs from another dense grid in a box alone."""
        planned = last.planning_view(unknown)
        values, states = planned.values.clone(), self.evidence
        part = box.window(self.box.lower.double().numpy(), self.spacing.double().numpy(), self.shape)
        values[part] = self.values[part]
        if states is not None:
            values[part][..., 0] = planning_raw(self.values[part][..., 0], states[part], unknown)
        return replace(self, values=values).differing_from(planned, box)

    def differing_from(self: G, before: "GridField", box: Box) -> G:
        """Note that this new field differs from another one in a box alone [m], and return it."""
        object.__setattr__(self, "origin", Origin(weakref.ref(before), box))
        return self

    def to(self: G, device: torch.device | str) -> G:
        """The same field with its tensors on a device; away from the CPU, torch does what kernels do here."""
        parts = {part.name: getattr(self, part.name) for part in fields(self)}
        moved = {name: part.to(device) for name, part in parts.items() if hasattr(part, "to")}
        return replace(self, **moved)

    @property
    def solid_density(self) -> float:
        """Density above which planners take a place for solid [1/m]."""
        return solid_density(self.resolution)

    @cached_property
    def spacing(self) -> Float[Tensor, "3"]:
        """Distance of neighbouring nodes along x, y, z [m]."""
        return spacing_of(self.box, self.shape)

    @property
    def resolution(self) -> float:
        """Distance of neighbouring nodes [m], the largest of the three axes."""
        return float(self.spacing.max())

    @property
    def step(self) -> float:
        """Distance of samples along rays [m]: half a voxel."""
        return 0.5 * float(self.spacing.min())

    def density(self, points: Points) -> Float[Tensor, "*batch"]:
        """rho at world points [1/m], differentiable twice; 0 outside the box."""
        raw = self.between_nodes(points, slice(0, 1))[..., 0]
        density = DENSITY_SCALE * torch.nn.functional.softplus(raw)
        return torch.where(self.box.contains(points), density, torch.zeros_like(density))

    def radiance(self, points: Points, directions: Points) -> Points:
        """Colour in [0, 1] at world points [m]; `directions` do not matter."""
        return self.between_nodes(points, slice(1, 4))

    def samples(self, origins: Float[Tensor, "n 3"], directions: Float[Tensor, "n 3"]) -> RaySamples:
        """The samples, every half voxel, that have density and are not hidden behind others."""
        if self.background.device.type != "cpu":
            return uniform_samples(self.box, origins, directions, self.step)
        rays = (flat_array(origins), flat_array(directions))
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
        """Render the surroundings along rays, in torch; None where the field has none."""
        return None if self.outside is None else self.outside.backdrop(self.box, origins, directions)

    def density_and_gradient(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """rho (n) [1/m] and its gradient (n, 3) [1/m^2] at world points (n, 3) [m], in float64, compiled."""
        density, gradient = np.empty(len(points)), np.empty((len(points), 3))
        arguments = (*self.kernel_grid, DENSITY_SCALE, points, density, gradient)
        if len(points) < _WORTH_THREADS:
            cells.density_and_gradient(*arguments)
        else:
            with threads(default_threads()):
                cells.density_and_gradient_parallel(*arguments)
        return density, gradient

    def render_rays(self, origins: Float[Tensor, "n 3"], directions: Float[Tensor, "n 3"]) -> Rendering:
        """Colours, opacities and depths by the compiled kernel, or in torch on another device; no gradients."""
        if (device := self.background.device).type != "cpu":
            with torch.no_grad():
                return render_rays(self, origins.to(device), directions.to(device))
        with threads(default_threads()):
            parts = march.render(
                *self.kernel_grid, flat_array(origins), flat_array(directions), np.float32(DENSITY_SCALE),
                np.float32(self.step), self.background.cpu().numpy(), self._outer,
            )  # fmt: skip
        return Rendering(*(torch.from_numpy(part) for part in parts))

    def colors_and_jacobian(
        self, origins: Float[Tensor, "n 3"], directions: Float[Tensor, "n 3"]
    ) -> tuple[Float[Tensor, "n 3"], Float[Tensor, "n 3 6"]]:
        """Colours of rays and their derivatives by the camera's motion (see field/render/jacobian.py), compiled."""
        colors, jacobians = self._seen_with_jacobian(flat_array(origins), flat_array(directions))
        return torch.from_numpy(colors), torch.from_numpy(jacobians)

    def _seen_with_jacobian(self, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Colours (n, 3) and Jacobians (n, 3, 6) of rays."""
        return jacobian.colors_and_jacobian(
            *self.kernel_grid, origins, directions, np.float32(DENSITY_SCALE), np.float32(self.step),
            self.background.cpu().numpy(), self._outer,
        )  # fmt: skip

    @cached_property
    def _outer(self) -> Shells:
        """Surroundings as kernels take them."""
        return whole_shells(self._outer_values)

    @cached_property
    def _outer_values(self) -> np.ndarray:
        """No nodes where there is nothing."""
        return np.zeros((0, 0, 0, 4), np.float32) if self.outside is None else flat_array(self.outside.values)


def grey_nodes(size: tuple[int, ...], raw: float) -> Float[Tensor, "*nodes 4"]:
    """Values of grey nodes that all have the same raw density."""
    values = torch.full((*size, 4), 0.5)
    values[..., 0] = raw
    return values


def flat_array(tensor: Tensor) -> np.ndarray:
    """Numbers as kernels take them: float32, row by row."""
    return np.ascontiguousarray(tensor.detach().cpu().numpy(), dtype=np.float32)

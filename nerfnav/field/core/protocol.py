"""Field protocol: density and colour of a radiance field inside a box, and the samples along rays through it.

Notation: rho(p) is the density at point p [1/m]: the chance per metre that a ray stops there. A sample i of a ray
stands for `step` metres of it and stops the light with alpha_i = 1 - exp(-rho_i step).
"""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from nerfnav.geometry import Box

Points = Float[Tensor, "*batch 3"]
LAST_SAMPLE = 0.499
"""A ray has floor(length / step + LAST_SAMPLE) samples: the middle of the last one is inside, rounding included."""


@dataclass(frozen=True)
class RaySamples:
    """Samples of n rays: rows padded to the length of the longest."""

    distances: Float[Tensor, "n s"]
    """Distance of each sample from its ray's origin [m], ascending; 0 where padded."""
    mask: Bool[Tensor, "n s"]
    """Entries that are samples and not padding."""
    step: float
    """Length of ray that each sample stands for [m]."""


@runtime_checkable
class Field(Protocol):
    """Density and colour inside a box; zero density outside it."""

    @property
    def box(self) -> Box:
        """Domain of the field."""
        ...

    @property
    def background(self) -> Float[Tensor, "3"]:
        """Colour of a ray that nothing stops, in [0, 1]; all colours are sRGB, as in photographs."""
        ...

    @property
    def resolution(self) -> float:
        """Distance of neighbouring nodes [m], the largest of the three axes; of samples, for a field without nodes."""
        ...

    def density(self, points: Points) -> Float[Tensor, "*batch"]:
        """rho at world points [m], in 1/m, differentiable twice; 0 outside the box."""
        ...

    def radiance(self, points: Points, directions: Points) -> Points:
        """Colour in [0, 1] that points [m] send against unit viewing directions; differentiable twice."""
        ...

    def samples(self, origins: Float[Tensor, "n 3"], directions: Float[Tensor, "n 3"]) -> RaySamples:
        """Sample rays so that what is left out changes no colour by more than about 1e-3."""
        ...


@runtime_checkable
class FastDensity(Protocol):
    """A field that has densities and their gradients faster than autograd."""

    def density_and_gradient(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Density and gradient, as the function of this name gives them."""
        ...


def density_and_gradient(field: Field, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """rho (n) [1/m] and d rho / d p (n, 3) [1/m^2] at world points (n, 3) [m], all in float64."""
    if isinstance(field, FastDensity):
        return field.density_and_gradient(points)
    with torch.enable_grad():  # also where the caller needs no other derivative
        at = torch.from_numpy(points).to(field.box.lower.device).requires_grad_()
        density = field.density(at)
        (gradient,) = torch.autograd.grad(density.sum(), at)
    return density.detach().double().cpu().numpy(), gradient.double().cpu().numpy()


def density_at(field: Field, points: np.ndarray) -> np.ndarray:
    """rho (n) [1/m] at world points (n, 3) [m], both in float64: by compiled kernels where the field has them."""
    if isinstance(field, FastDensity):
        return field.density_and_gradient(points)[0]
    with torch.no_grad():
        return field.density(torch.from_numpy(points).to(field.box.lower.device)).double().cpu().numpy()


_RIM = 1e-6
"""Share of the box by which points on its border are moved inwards."""


def density_in_box(field: Field, points: np.ndarray) -> np.ndarray:
    """`density_at` points of the box: its border belongs to it, however coordinates are rounded.

    Points beyond the border count as those on it that are nearest.
    """
    box = field.box.to("cpu").to(torch.float64)
    rim = _RIM * box.size
    return density_at(field, torch.from_numpy(points).clamp(box.lower + rim, box.upper - rim).numpy())


def box_interval(
    box: Box, origins: Float[Tensor, "n 3"], directions: Float[Tensor, "n 3"]
) -> tuple[Float[Tensor, "n"], Float[Tensor, "n"]]:
    """Distances [m] at which rays enter and leave the box; enter >= leave where they miss it."""
    inverse = 1 / torch.where(directions.abs() < 1e-9, torch.full_like(directions, 1e-9), directions)
    first, second = (box.lower - origins) * inverse, (box.upper - origins) * inverse
    enter = torch.minimum(first, second).amax(-1).clamp_min(0)
    return enter, torch.maximum(first, second).amin(-1)


def bins_in_box(
    box: Box, origins: Float[Tensor, "n 3"], directions: Float[Tensor, "n 3"], step: float
) -> tuple[Float[Tensor, "n"], Bool[Tensor, "n b"]]:
    """Distances [m] at which rays enter the box, and which bins of `step` metres from there have their middle in it."""
    enter, leave = box_interval(box, origins, directions)
    counts = torch.floor((leave - enter) / step + LAST_SAMPLE).clamp_min(0)
    return enter, torch.arange(max(1, int(counts.max())), device=origins.device) < counts[:, None]


def chosen_samples(chosen: Bool[Tensor, "n b"], enter: Float[Tensor, "n"], step: float) -> RaySamples:
    """The middles of the chosen ones among bins of `step` metres along rays, the first of which begin at `enter` [m].

    Rows are as short as they can be.
    """
    most = max(1, int(chosen.sum(1).max()))
    # a stable sort brings what is chosen to the front and keeps its order
    order = torch.argsort(~chosen, dim=1, stable=True)[:, :most]
    mask = torch.gather(chosen, 1, order)
    distances = enter[:, None] + (order + 0.5) * step
    return RaySamples(torch.where(mask, distances, torch.zeros_like(distances)), mask, step)


@torch.no_grad()
def uniform_samples(
    box: Box, origins: Float[Tensor, "n 3"], directions: Float[Tensor, "n 3"], step: float
) -> RaySamples:
    """A sample in the middle of every `step` metres of each ray inside the box."""
    enter, mask = bins_in_box(box, origins, directions, step)
    distances = enter[:, None] + (torch.arange(mask.shape[1], device=origins.device) + 0.5) * step
    return RaySamples(torch.where(mask, distances, torch.zeros_like(distances)), mask, step)

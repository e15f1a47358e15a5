"""Contracted surroundings: a second grid for everything around the box, for photographs of places without an end.

Notation, in units of half the box along each axis, with the box's centre as origin: q is a point, s = max |q_i| says
on which shell it lies (a box s times as large as the field's). Contracted space is

    u = (2 - 1/s) q/s

(Barron et al., "Mip-NeRF 360", CVPR 2022, Eq. 10, with the maximum norm): all that lies outside the box becomes the
layer 1 <= max |u_i| <= 2, and the grid of n^3 nodes spans -2 to 2. There are K = n / 2 shells, evenly spaced in u,
s_k = K / (K - k - 1/2). A ray meets each where it leaves it for good, and there alpha_k = 1 - exp(-d softplus(raw));
the last one is opaque, so that no ray ends in nothing. What lies between a camera and the box in front of it is
taken as clear: the surroundings are a backdrop, so that no fog can grow before cameras that stand outside.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.field.kernels import shells
from nerfnav.geometry import Box, trilinear

RAW_TO_DEPTH = float(shells.RAW_TO_DEPTH)
"""Optical depth of a shell for a softplus of 1."""
SPAN = Box.of((-2.0, -2.0, -2.0), (2.0, 2.0, 2.0))
"""Contracted space."""
Rays = Float[Tensor, "n 3"]


@dataclass(frozen=True)
class Backdrop:
    """Colour, opacity and depth of the surroundings along rays that have left the box."""

    color: Float[Tensor, "n 3"]
    """In [0, 1]; black where the ray goes on to the background."""
    opacity: Float[Tensor, "n"]
    """Share of the light that is stopped."""
    depth: Float[Tensor, "n"]
    """Mean distance of what stops it [m]; 0 where nothing does."""


@dataclass(frozen=True)
class Surroundings:
    """Raw density and colour on a grid over contracted space."""

    values: Float[Tensor, "m m m 4"]
    """Raw density, red, green, blue of each node; those inside the box are never used."""

    def to(self, device: torch.device | str) -> "Surroundings":
        """The same surroundings on a device."""
        return Surroundings(self.values.to(device))

    @property
    def shells(self) -> int:
        """K, how many shells a ray can meet."""
        return self.values.shape[0] // 2

    def backdrop(
        self, box: Box, origins: Rays, directions: Rays, jitter: Float[Tensor, "n"] | None = None
    ) -> Backdrop:
        """Render the surroundings of `box` along rays (origins [m], unit directions), in torch, differentiable.

        `jitter` moves all shells of a ray by a share of their distance, -0.5 to 0.5 (exclusive).
        """
        distance, contracted = self.crossings(box, origins, directions, jitter)
        mixed = trilinear(self.values, SPAN.to(self.values.device), contracted)
        through = torch.exp(-RAW_TO_DEPTH * torch.nn.functional.softplus(mixed[..., 0]))
        through = torch.cat([through[:, :-1], torch.zeros_like(through[:, :1])], 1)
        through = torch.where(distance >= 0, through, torch.ones_like(through))
        light = torch.cumprod(through, 1)
        weights = torch.cat([torch.ones_like(light[:, :1]), light[:, :-1]], 1) - light
        opacity = 1 - light[:, -1]
        color = (weights[..., None] * mixed[..., 1:]).sum(1)
        depth = (weights * distance.clamp_min(0)).sum(1) / opacity.clamp_min(1e-6)
        return Backdrop(color, opacity, depth)

    def crossings(
        self, box: Box, origins: Rays, directions: Rays, jitter: Float[Tensor, "n"] | None = None
    ) -> tuple[Float[Tensor, "n k"], Float[Tensor, "n k 3"]]:
        """Distances [m] at which rays leave the shells, -1 for those they miss, and the contracted points u there."""
        half = (0.5 * box.size).to(origins)
        at, along = (origins - box.center.to(origins)) / half, directions / half
        along = torch.where(along.abs() < 1e-9, torch.full_like(along, 1e-9), along)
        index = torch.arange(self.shells, device=origins.device, dtype=origins.dtype)
        position = index + (0.0 if jitter is None else jitter[:, None])
        size = (self.shells / (self.shells - position - 0.5)).expand(len(origins), -1)[..., None]
        first, second = (-size - at[:, None]) / along[:, None], (size - at[:, None]) / along[:, None]
        enter = torch.minimum(first, second).amax(-1).clamp_min(0)
        leave = torch.maximum(first, second).amin(-1)
        points = at[:, None] + leave[..., None] * along[:, None]
        return torch.where(leave > enter, leave, -torch.ones_like(leave)), points * (2 - 1 / size) / size


def uncontracted(box: Box, points: Float[Tensor, "*batch 3"]) -> Float[Tensor, "*batch 3"]:
    """World points [m] that contracted ones stand for; those at infinity are put a thousand boxes away."""
    radius = points.abs().amax(-1, keepdim=True)
    size = torch.where(radius > 1, 1 / (2 - radius).clamp_min(1e-3), radius)
    return box.center + 0.5 * box.size * points * size / radius.clamp_min(1e-9)

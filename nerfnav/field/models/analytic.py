"""Analytic fields: exact, tiny and smooth fields given by formulas, for tests and first steps."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.field.core.protocol import Points, RaySamples, uniform_samples
from nerfnav.geometry import Box


@dataclass(frozen=True)
class BallsField:
    """Soft balls: density peak * sum_k sigmoid((radius_k - |p - center_k|) / softness).

    The colour varies smoothly with the position, so that a picture says where it was taken from.
    """

    box: Box
    """Domain of the field."""
    centers: Float[Tensor, "k 3"]
    """Middles of the balls [m]."""
    radii: Float[Tensor, "k"]
    """Radii [m]."""
    softness: float = 0.01
    """Width of the border over which the density rises [m]."""
    peak: float = 200.0
    """Density inside [1/m]."""
    color_period: float = 0.4
    """Length over which the colour repeats [m]."""
    step: float = 0.01
    """Distance of samples along rays [m]."""

    @property
    def background(self) -> Float[Tensor, "3"]:
        """White, for all rays."""
        return torch.ones(3, dtype=self.centers.dtype)

    @property
    def resolution(self) -> float:
        """Distance of samples [m]: a formula has no nodes."""
        return self.step

    def density(self, points: Points) -> Float[Tensor, "*batch"]:
        """rho at world points [1/m]; 0 outside the box."""
        offset = points[..., None, :] - self.centers.to(points)
        distance = (offset.square().sum(-1) + 1e-12).sqrt()
        soft = torch.sigmoid((self.radii.to(points) - distance) / self.softness).sum(-1)
        return torch.where(self.box.contains(points), self.peak * soft, torch.zeros_like(soft))

    def radiance(self, points: Points, directions: Points) -> Points:
        """A smooth colour pattern in space, the same from all directions."""
        phase = torch.tensor([0.0, 1.0, 2.0], dtype=points.dtype)
        waves = torch.sin(2 * torch.pi * points / self.color_period + phase)
        return 0.5 + 0.3 * waves + 0.15 * waves.roll(1, -1)

    def samples(self, origins: Float[Tensor, "n 3"], directions: Float[Tensor, "n 3"]) -> RaySamples:
        """Uniform samples, every `step` metres."""
        return uniform_samples(self.box, origins, directions, self.step)

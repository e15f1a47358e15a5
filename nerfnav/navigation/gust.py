"""Gust: a single push of a flying robot, as strong as the robot can recover from within its clearance.

A robot that decelerates by a stops from the speed sqrt(2 a c) within a clearance c. The change of speed by a gust is at
most a fifth of that, and its displacement at most a fifth of the clearance.
"""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import normalize

from nerfnav.robots import Robot

_SHARE = 0.2
"""Largest share of the recoverable speed, and of the clearance, that a gust takes."""


@dataclass(frozen=True)
class GustStrength:
    """Sizes of the changes of a state by a gust; their directions are random."""

    position_m: float
    """Displacement [m]."""
    velocity_mps: float
    """Change of velocity [m/s]."""
    attitude_rad: float
    """Rotation [rad]."""
    body_rate_radps: float
    """Change of the body rate [rad/s]."""

    def scaled(self, factor: float) -> "GustStrength":
        """Scale all four sizes."""
        return GustStrength(
            factor * self.position_m,
            factor * self.velocity_mps,
            factor * self.attitude_rad,
            factor * self.body_rate_radps,
        )

    def sample(self, generator: torch.Generator) -> Float[Tensor, "12"]:
        """Draw one tangent vector: directions evenly distributed, sizes exact."""
        sizes = torch.tensor([self.position_m, self.velocity_mps, self.attitude_rad, self.body_rate_radps])
        return (sizes[:, None] * normalize(torch.randn(4, 3, generator=generator), dim=-1)).flatten()


def fit_gust(largest: GustStrength, robot: Robot, clearance_m: float) -> GustStrength:
    """Scale a gust down to what a robot recovers from within its clearance [m]; to nothing without clearance."""
    recoverable = math.sqrt(2 * robot.deceleration * clearance_m)
    factor = min(1.0, _SHARE * recoverable / largest.velocity_mps, _SHARE * clearance_m / largest.position_m)
    return largest.scaled(factor)

"""Wind: a steady part, and gusts by Dryden's spectra (MIL-F-8785C, 3.7), which the wind itself carries past the robot.

With tau = L / V, the gust along the wind is white noise through sigma sqrt(2 tau) / (1 + tau s); those across it and
upward through sigma sqrt(tau) (1 + sqrt(3) tau s) / (1 + tau s)^2. All begin in their stationary distribution.
"""

import math
from dataclasses import dataclass

import numpy as np
import torch

from nerfnav.navigation.physical.config import PhysicalConfig

_CALM = 0.1
"""Least speed [m/s] with which gusts are carried past."""


@dataclass
class Wind:
    """Wind at one place; `blow` lets time pass."""

    config: PhysicalConfig
    """How strong."""
    generator: torch.Generator
    """Decides direction and gusts."""

    def __post_init__(self) -> None:
        """Draw the direction and the first gust."""
        heading = math.tau * float(torch.rand(1, generator=self.generator))
        cos, sin = math.cos(heading), math.sin(heading)
        self._axes = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        self._once, second = self._drawn(2)
        self._twice = 0.5 * (self._once + second)  # covariance of the two filters: half the first one's variance

    def blow(self, dt: float) -> np.ndarray:
        """Velocity of the air in the world `dt` [s] later [m/s]."""
        share = dt * max(_CALM, self.config.wind_mps) / self.config.gust_length_m
        kept = math.exp(-share)
        before = self._once
        self._once = kept * before + math.sqrt(1 - kept**2) * self._drawn(1)[0]
        self._twice = self._twice + (1 - kept) * (before - self._twice)
        along = self._once[0]
        across = math.sqrt(1.5) * self._once[1:] + math.sqrt(0.5) * (1 - math.sqrt(3)) * self._twice[1:]
        gust = np.array([along, *across]) * self.config.gust_std_mps
        return self._axes @ (gust + np.array([self.config.wind_mps, 0.0, 0.0]))

    def _drawn(self, count: int) -> np.ndarray:
        return torch.randn(count, 3, generator=self.generator, dtype=torch.float64).numpy()

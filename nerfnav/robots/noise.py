"""Gaussian noise of a robot's state: process noise of a time step, and error of an estimate.

Filters assume it, simulators draw it, and planners predict the tracking error from it.
"""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.errors import require_not_negative


@runtime_checkable
class ProcessNoise(Protocol):
    """Noise that a time step adds to a state, of zero mean."""

    def covariance(self) -> Float[Tensor, "12 12"]:
        """Return the covariance in the tangent of the state."""
        ...


@dataclass(frozen=True)
class StateNoise:
    """Standard deviations of independent noise in the tangent of a state.

    The defaults are the paper's process noise of one time step: 2 cm and 0.02 rad, half of that on the rates.
    """

    position_m: float = 0.02
    """Deviation of each coordinate of the position [m]."""
    velocity_mps: float = 0.01
    """Deviation of each coordinate of the velocity [m/s]."""
    attitude_rad: float = 0.02
    """Deviation of each coordinate of the attitude's tangent [rad]."""
    body_rate_radps: float = 0.01
    """Deviation of each coordinate of the body rate [rad/s]."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError unless all four are finite and at least 0."""
        require_not_negative(**vars(self))

    @classmethod
    def isotropic(cls, variance: float) -> "StateNoise":
        """Set the same variance on all twelve numbers, as the paper's 0.1 I."""
        return cls(*(variance**0.5,) * 4)

    @property
    def deviations(self) -> tuple[float, float, float, float]:
        """Return the deviations of position [m], velocity [m/s], attitude [rad] and body rate [rad/s]."""
        return self.position_m, self.velocity_mps, self.attitude_rad, self.body_rate_radps

    def scaled(self, factor: float) -> "StateNoise":
        """Return the noise with `factor` times the standard deviations."""
        return StateNoise(*(factor * value for value in self.deviations))

    def std(self, dtype: torch.dtype = torch.float32) -> Float[Tensor, "12"]:
        """Return the standard deviation of each tangent number."""
        return torch.tensor(self.deviations, dtype=dtype).repeat_interleave(3)

    def covariance(self, dtype: torch.dtype = torch.float32) -> Float[Tensor, "12 12"]:
        """Return the covariance, which is diagonal."""
        return torch.diag(self.std(dtype).square())

    def sample(self, generator: torch.Generator) -> Float[Tensor, "12"]:
        """Draw one tangent vector."""
        return self.std() * torch.randn(12, generator=generator)


@dataclass(frozen=True)
class NoiseModel:
    """Noise of a flight, from which the tracking error is predicted."""

    process: StateNoise = StateNoise()
    """Noise of each time step; by default the paper's."""
    estimate: StateNoise = StateNoise(0.005, 0.02, 0.005, 0.02)
    """Error of the estimate from which a plan starts; by default that of flights by camera alone."""


PAPER_NOISE = NoiseModel()
"""Noise of the paper's flights."""


@dataclass(frozen=True)
class RandomAcceleration:
    """White-noise acceleration over a step, linear and angular (Bar-Shalom, "Estimation with Applications", 6.2).

    With a spectral density q^2 each coordinate and its rate gain q^2 [[dt^3 / 3, dt^2 / 2], [dt^2 / 2, dt]]: noise is a
    rate per second, and two steps of any lengths add as much as one of their sum.
    """

    dt: float
    """Length of the step [s]."""
    linear: float
    """q of velocities [m/s per sqrt(s)]."""
    angular: float
    """q of body rates [rad/s per sqrt(s)]."""

    def covariance(self) -> Float[Tensor, "12 12"]:
        """Return the covariance in the tangent of the state."""
        dt, eye = self.dt, torch.eye(3)
        parts = torch.tensor([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
        return torch.block_diag(*(torch.kron(size**2 * parts, eye) for size in (self.linear, self.angular)))


@dataclass(frozen=True)
class MeasuredNoise:
    """Process noise of a known covariance."""

    matrix: Float[Tensor, "12 12"]
    """Covariance in the tangent of the state."""

    def covariance(self) -> Float[Tensor, "12 12"]:
        """Return the covariance in the tangent of the state."""
        return self.matrix

"""Gaussian noise on a state: what a filter assumes and what a simulator applies, in one record."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.errors import InvalidInputError


@runtime_checkable
class ProcessNoise(Protocol):
    """What a time step adds to a state, of zero mean."""

    def covariance(self) -> Float[Tensor, "12 12"]:
        """In the tangent of the state."""
        ...


@dataclass(frozen=True)
class StateNoise:
    """Standard deviations of independent noise in the tangent of a state.

    The defaults are the paper's process noise of one time step: 2 cm and 0.02 rad, half of that on the rates.
    """

    position_m: float = 0.02
    """On each coordinate of the position [m]."""
    velocity_mps: float = 0.01
    """On each coordinate of the velocity [m/s]."""
    attitude_rad: float = 0.02
    """On each coordinate of the attitude's tangent [rad]."""
    body_rate_radps: float = 0.01
    """On each coordinate of the body rate [rad/s]."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError unless all four are finite and at least 0."""
        if not all(0 <= value < float("inf") for value in self.deviations):
            raise InvalidInputError(f"standard deviations must be finite and at least 0, not {self.deviations}")

    @classmethod
    def isotropic(cls, variance: float) -> "StateNoise":
        """The same variance on all twelve numbers, as the paper's 0.1 I."""
        return cls(*(variance**0.5,) * 4)

    @property
    def deviations(self) -> tuple[float, float, float, float]:
        """Standard deviations of position [m], velocity [m/s], attitude [rad] and body rate [rad/s]."""
        return self.position_m, self.velocity_mps, self.attitude_rad, self.body_rate_radps

    def std(self) -> Float[Tensor, "12"]:
        """Standard deviation of each tangent number."""
        return torch.tensor(self.deviations, dtype=torch.float32).repeat_interleave(3)

    def covariance(self) -> Float[Tensor, "12 12"]:
        """The diagonal covariance."""
        return torch.diag(self.std().square())

    def sample(self, generator: torch.Generator) -> Float[Tensor, "12"]:
        """One random tangent vector."""
        return self.std() * torch.randn(12, generator=generator)


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
        """In the tangent of the state."""
        dt, eye = self.dt, torch.eye(3)
        parts = torch.tensor([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
        return torch.block_diag(*(torch.kron(size**2 * parts, eye) for size in (self.linear, self.angular)))


@dataclass(frozen=True)
class MeasuredNoise:
    """Process noise of a covariance that is known."""

    told: Float[Tensor, "12 12"]
    """The covariance."""

    def covariance(self) -> Float[Tensor, "12 12"]:
        """In the tangent of the state."""
        return self.told

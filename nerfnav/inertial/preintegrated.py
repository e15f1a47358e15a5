"""Preintegrated measurements of an IMU between two times, independent of the state.

(Preintegration: Forster, Carlone, Dellaert and Scaramuzza, "On-manifold preintegration for real-time visual-inertial
odometry", 2017.)
"""

from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor

from nerfnav.inertial.strapdown import Increments

TURN, SPEED, PLACE = slice(0, 3), slice(3, 6), slice(6, 9)
"""Slices of the preintegrated numbers."""
GYRO, ACCEL = slice(0, 3), slice(3, 6)
"""Slices of the biases."""


@dataclass(frozen=True)
class Preintegrated:
    """Measurements between two times, in the unit's axes at the first."""

    increments: Increments
    """Turn, change of velocity and of position, and the last body rate, without biases."""
    rate_variance: float
    """Of the last body rate [rad^2/s^2]."""
    duration: float
    """Time between the two [s]."""
    by_biases: Float[Tensor, "9 6"]
    """Derivative of turn, velocity and position by the biases."""
    covariance: Float[Tensor, "9 9"]
    """Of turn, velocity and position."""

"""Belief: the state estimate, a Gaussian in the tangent of its mean."""

from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor

from nerfnav.core.structs import TensorStruct
from nerfnav.robots import POSITION, RigidState


@dataclass(frozen=True)
class Belief(TensorStruct):
    """x = mean (+) d with d ~ N(0, covariance)."""

    mean: RigidState
    """Most likely state."""
    covariance: Float[Tensor, "*batch 12 12"]
    """In the tangent of the mean: position, velocity, attitude, body rate (see robots/state.py)."""

    @property
    def spread(self) -> float:
        """The largest standard deviation of a coordinate of the position [m], of one belief."""
        return float(self.covariance.diagonal()[POSITION].max().sqrt())

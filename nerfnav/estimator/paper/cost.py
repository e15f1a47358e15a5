"""Cost of the filter (paper Eq. 6): the photometric term plus the process term.

J(x) = J_photo(x) + d' (Sigma-)^-1 d,   d = x (-) mu-
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.estimator.core.belief import POSE, Belief, hessian
from nerfnav.estimator.photometric.residuals import ColorNoise, Observation, inliers, photometric_cost
from nerfnav.robots import TANGENT, RigidState


@dataclass(frozen=True)
class CostTerms:
    """Cost J at one state, by its terms."""

    photometric: Float[Tensor, ""]
    """J_photo."""
    process: Float[Tensor, ""]
    """The squared Mahalanobis distance from the prediction."""
    residual: Float[Tensor, "m 3"]
    """r_i of each pixel."""
    believed: Bool[Tensor, " m"]
    """Inliers among the pixels."""

    @property
    def total(self) -> Float[Tensor, ""]:
        """Total cost J at the state."""
        return self.photometric + self.process


@dataclass(frozen=True)
class PoseCost:
    """Cost J as a function of the state."""

    observation: Observation
    """The pixels that are compared."""
    prediction: Belief
    """mu- and Sigma-."""
    information: Float[Tensor, "12 12"]
    """(Sigma-)^-1."""
    noise: ColorNoise
    """Noise of colours at the right pose."""

    @classmethod
    def of(cls, observation: Observation, prediction: Belief, noise: ColorNoise) -> "PoseCost":
        """Build J for a picture and a prediction; raises InvalidInputError where Sigma- is no covariance."""
        return cls(observation, prediction, precision(prediction.covariance), noise)

    def terms(self, state: RigidState) -> CostTerms:
        """Return J at a state, differentiable; inliers are chosen afresh, outside the gradient."""
        residual = self.observation.residual(state)
        believed = inliers(residual, self.noise)
        return CostTerms(photometric_cost(residual, believed, self.noise), self.process(state), residual, believed)

    def process(self, state: RigidState) -> Float[Tensor, ""]:
        """Return the process term at a state."""
        change = self.prediction.mean.local(state)
        return change @ self.information @ change

    def hessian(self, state: RigidState) -> Float[Tensor, "12 12"]:
        """Return the exact second derivatives of J in the tangent at a state, whose outliers stay outliers.

        The photometric term depends on six of the twelve numbers only, which spares half of the work.
        """
        samples = self.observation.samples(state)
        with torch.no_grad():
            believed = self.terms(state).believed
        place = torch.eye(TANGENT, dtype=state.position.dtype)[POSE]

        def photometric(pose_tangent: Float[Tensor, "6"]) -> Float[Tensor, ""]:
            residual = self.observation.residual(state.retract(pose_tangent @ place), samples)
            return photometric_cost(residual, believed, self.noise)

        zero = torch.zeros(TANGENT, dtype=state.position.dtype)
        seen = place.T @ hessian(photometric, zero[POSE]) @ place
        return seen + hessian(lambda tangent: self.process(state.retract(tangent)), zero)


def precision(covariance: Float[Tensor, "n n"]) -> Float[Tensor, "n n"]:
    """Return the inverse of a predicted covariance; raises InvalidInputError where it is none."""
    root, failed = torch.linalg.cholesky_ex(covariance.double())
    if failed or not covariance.isfinite().all():
        raise InvalidInputError(
            "the predicted covariance is not finite and positive definite: "
            "start from a positive definite one, or add process noise"
        )
    return torch.cholesky_inverse(root).to(covariance)

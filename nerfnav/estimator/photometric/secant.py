"""Secant statistics: derivatives of a picture's colours at the scale of the uncertainty, not at a point.

A learned field is rough: over millimetres its colours change by stains that its pictures taught it. There, slopes at a
point overstate what a picture tells about centimetres, and descents by them stall in small minima. So colours C are
taken over the whole uncertainty P of the pose. With P = L L', and l_i the columns of L, at x (+) +-sqrt(6) l_i,

    c = mean of the 12 renderings,   D_i = (C(+ l_i) - C(- l_i)) / (2 sqrt 6)
    e = mean of (C - c)^2 - sum of D_i^2 >= 0         (what is not straight counts as noise)

(unscented transform, Julier and Uhlmann 2004; statistical linearisation, Gelb, "Applied optimal estimation", 1974,
Sec. 6.2).
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.estimator.photometric.kernels.secant import sum_secants
from nerfnav.estimator.photometric.levenberg_marquardt import EXPOSURE, POSE, Guess
from nerfnav.estimator.photometric.residuals import Observation, shown
from nerfnav.geometry import Pose, so3

_AWAY = 6.0**0.5
"""Distance of the renderings from the middle [standard deviations]: of six numbers, the second moments are exact."""


@dataclass(frozen=True)
class Secants:
    """Sums over the colours of a picture, by secants over the covariance P of a pose; 64 bits.

    Unknowns are the six standard deviations (columns of L), gain and bias.
    """

    root: Float[Tensor, "6 6"]
    """L."""
    information: Float[Tensor, "8 8"]
    """Information J'WJ of independent colours; W is Huber's weight over the variance s^2 + e."""
    push: Float[Tensor, "8"]
    """J'Wr, with r the mean colour less the picture's."""
    misfit: float
    """Mean of w r^2."""
    pixels: int
    """Pixels whose colours these are."""

    def __add__(self, other: "Secants") -> "Secants":
        """Return the sums over the colours of both, which are over the same covariance."""
        pixels = self.pixels + other.pixels
        misfit = (self.pixels * self.misfit + other.pixels * other.misfit) / pixels
        return Secants(self.root, self.information + other.information, self.push + other.push, misfit, pixels)

    def pose_information(self, alike: float, exposure: Float[Tensor, "2 2"]) -> Float[Tensor, "6 6"]:
        """Return the information on the pose [1/m^2, 1/rad^2] where so many colours err `alike`.

        Gain and bias, of which `exposure` is known, are marginalised (Schur's complement).
        """
        whole, inverse = self.information / alike, torch.linalg.inv(self.root)
        cross = whole[POSE, EXPOSURE]
        seen = whole[POSE, POSE] - cross @ torch.linalg.solve(whole[EXPOSURE, EXPOSURE] + exposure.double(), cross.T)
        return inverse.T @ seen @ inverse


@torch.no_grad()
def measure_secants(
    seen: Observation, guess: Guess, covariance: Float[Tensor, "6 6"], noise_std: float, robust: float
) -> Secants:
    """Measure the secants of the colours over the `covariance` of one pose (1,).

    `noise_std` is s, of one colour, and `robust` Huber's bound [1 = full scale].
    """
    pose, root = guess.pose[0], torch.linalg.cholesky(covariance.double())
    away = _AWAY * torch.cat([root.T, -root.T]).to(pose.position)
    poses = Pose(so3.retract(pose.rotation.expand(len(away), 3, 3), away[:, 3:]), pose.position + away[:, :3])
    information, push, (gain, bias) = np.empty((8, 8)), np.empty(8), guess.exposure[0].tolist()
    colors, bounds = np.ascontiguousarray(seen.colors.numpy()), (_AWAY, noise_std**2, robust)
    misfit = sum_secants(shown(seen, poses), colors, (gain, bias), bounds, information, push)
    return Secants(root, torch.from_numpy(information), torch.from_numpy(push), misfit, len(colors))


def settle_information(
    seen: Observation,
    guess: Guess,
    covariance: Float[Tensor, "6 6"],
    known: Float[Tensor, "8 8"],
    noise_std: float,
    alike: float,
    robust: float,
    rounds: int,
) -> Float[Tensor, "6 6"]:
    """Return the information on one pose (1,), 64 bits, over the covariance that it leaves: a fixed point.

    It is iterated for so many `rounds`, at least one, from a first `covariance`; `known` is the prior information on
    pose and exposure, `alike` as in `pose_information`, the rest as in `measure_secants`.
    """
    known, information = known.double(), torch.zeros(6, 6).double()
    for _ in range(rounds):
        secants = measure_secants(seen, guess, covariance, noise_std, robust)
        information = secants.pose_information(alike, known[EXPOSURE, EXPOSURE])
        covariance = invert(information + known[POSE, POSE])
    return information


def invert(matrix: Float[Tensor, "n n"]) -> Float[Tensor, "n n"]:
    """Invert a symmetric matrix; the inverse is symmetric to the last bit."""
    inverse = torch.linalg.inv(matrix)
    return 0.5 * (inverse + inverse.T)

"""Secants in the filter: measure the information at a minimum over the uncertainty, and descend by secants.

Slopes at a pose are the cheap answer, and hold where a picture is textured. Where they overstate what the picture tells
(photometric/secant.py), the descent that used them has stalled as likely as not: Gauss and Newton's steps are then
taken by secants from the prediction, each over the P that the one before left, and end with a descent by slopes.
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.estimator.core.belief import POSE
from nerfnav.estimator.gauss_newton.alignment import are_alike, record
from nerfnav.estimator.gauss_newton.posterior import (
    Minimum,
    Selection,
    UpdateProblem,
    information_at,
    information_ratio,
)
from nerfnav.estimator.photometric.levenberg_marquardt import EXPOSURE, Guess, NewtonConfig, improve
from nerfnav.estimator.photometric.pixel_selection import PixelChoice, PixelSource, draw_by_gradient
from nerfnav.estimator.photometric.residuals import Observation
from nerfnav.estimator.photometric.secant import invert, measure_secants, settle_information


@dataclass(frozen=True)
class PoseGaussian:
    """Gaussian of the pose in a round."""

    guess: Guess
    """Mean pose, and exposure; batch shape (1,)."""
    covariance: Float[Tensor, "6 6"]
    """P, in the tangent of the pose; 64 bits."""


def overstates(problem: UpdateProblem, minimum: Minimum) -> bool:
    """Return True where slopes at a minimum overstate what its picture tells."""
    return _measure_overstated(problem, minimum, _Compared.of(problem, minimum)) is not None


def measure_information(problem: UpdateProblem, minimum: Minimum) -> Minimum:
    """Return a minimum with the information of its picture where slopes at the pose overstate that; else as it is."""
    by, rounds = _Compared.of(problem, minimum), problem.config.pyramid.secant.settle - 1
    found = _measure_overstated(problem, minimum, by)
    if found is None:
        return minimum
    if rounds > 0:
        over = invert(found + problem.pose_information.double())
        found = settle_information(by.seen, by.guess, over, by.prior, by.noise_std, by.alike, by.robust, rounds)
    return replace(minimum, information=found.to(problem.pose_information))


def _measure_overstated(
    problem: UpdateProblem, minimum: Minimum, compared: "_Compared"
) -> Float[Tensor, "6 6"] | None:
    """Measure the information of a minimum's picture in one round; None where that of its slopes holds.

    Half of the pixels find more often than all that slopes overstate: all decide only where half do.
    """
    config, slopes = problem.config.pyramid.secant, information_at(problem, minimum).double()
    known = problem.pose_information.double()
    over, secants, found = invert(slopes / config.widened**2 + known), None, None
    for first in range(2):
        half = replace(compared.seen, pixels=compared.seen.pixels[first::2], colors=compared.seen.colors[first::2])
        measured = measure_secants(half, compared.guess, over, compared.noise_std, compared.robust)
        secants = measured if secants is None else secants + measured
        alike = compared.alike * secants.pixels / len(compared.seen.pixels)
        found = secants.pose_information(alike, compared.prior[EXPOSURE, EXPOSURE])
        wider = float(torch.exp((torch.logdet(slopes + known) - torch.logdet(found + known)) / len(POSE)))
        if wider <= config.overstated:
            return None
    return found


@dataclass(frozen=True)
class _Compared:
    """Pixels of a minimum's picture that are compared, with their noise and prior (photometric/secant.py)."""

    seen: Observation
    guess: Guess
    prior: Float[Tensor, "8 8"]
    noise_std: float
    alike: float
    robust: float

    @classmethod
    def of(cls, problem: UpdateProblem, minimum: Minimum) -> "_Compared":
        selection = minimum.selection.observation
        seen, count = _thin(selection, problem.config.pyramid.secant.checked), len(selection.pixels)
        alike = problem.correlated(count) * len(seen.pixels) / count * information_ratio(problem, minimum)
        prior, noise_std = problem.prior(count).information, problem.config.color_noise.std
        return cls(seen, minimum.iterate.guess, prior, noise_std, alike, problem.config.pyramid.robust[-1])


def descend_secant(problem: UpdateProblem, before: Minimum) -> tuple[Minimum, Minimum | None]:
    """Return the minimum of a descent from the prediction that steps by secants, then by slopes, and its rival.

    `before` is the end of the descent by slopes, which may have stalled: both go on over the same pixels. Where they
    end apart, the one that costs more is the rival.
    """
    pyramid = problem.config.pyramid
    pixels = draw_by_gradient(problem.image, pyramid.pixels, problem.generator)
    seen = Observation.of(problem.image, pixels, problem.view.at(0))
    covariance = problem.prediction.covariance[POSE][:, POSE].double()
    here = PoseGaussian(Guess.at(problem.prediction.mean.pose[None]), covariance)
    few = _thin(seen, pyramid.secant.checked)
    for _ in range(pyramid.secant.rounds):
        here = _step(few, here, problem)
    newton = NewtonConfig(
        pyramid.iterations[-1], robust=pyramid.robust[-1], settled=pyramid.settled, stretch=pyramid.stretch
    )
    starts = Guess.cat([here.guess, before.iterate.guess])
    *_, ends = improve(seen, starts, problem.prior(len(pixels)), newton, every=False)
    selection = Selection(seen, pixels, PixelSource.FEATURES, PixelChoice(pixels, PixelSource.FEATURES))
    minima = [
        Minimum(record(problem, end, selection, before.step.iteration + 1), selection, end)
        for end in (ends[index : index + 1] for index in ends.cost.argsort().tolist())
    ]
    best, other = minima
    same = are_alike(ends.guess.pose[0], ends.guess.pose[1], pyramid.search.alike)
    return measure_information(problem, best), None if same else measure_information(problem, other)


def _step(seen: Observation, here: PoseGaussian, problem: UpdateProblem) -> PoseGaussian:
    """Take Gauss and Newton's step to the minimum, in units of P."""
    prior = problem.prior(len(seen.pixels))
    config = problem.config
    secants = measure_secants(seen, here.guess, here.covariance, config.color_noise.std, config.pyramid.robust[-1])
    scale = torch.block_diag(secants.root, torch.eye(2).double())
    known, change = prior.information.double(), prior.change_of(here.guess)[0].double()
    alike = problem.correlated(len(seen.pixels)) * max(1.0, secants.misfit)
    curvature = secants.information / alike + scale.T @ known @ scale
    push = secants.push / alike + scale.T @ (known @ change)
    step = -scale @ torch.linalg.solve(curvature, push)
    covariance = scale @ torch.linalg.inv(curvature) @ scale.T
    return PoseGaussian(here.guess.retract(step.float()[None]), 0.5 * (covariance + covariance.T)[:6, :6])


def _thin(seen: Observation, count: int) -> Observation:
    """Return evenly many of the pixels, which are in random order."""
    every = max(1, len(seen.pixels) // count)
    return replace(seen, pixels=seen.pixels[::every], colors=seen.colors[::every])

"""Posterior of a picture: test the end of a descent, and correct the prediction by it.

A minimum that fails the innovation gate or the residual gate leaves the prediction. One that noise does not explain,
or that has a rival, gives a downgraded posterior. Where two hypotheses remain, the posterior is one Gaussian of the
mixture's moments,

    mean m = sum w_i m_i,   covariance sum w_i (Sigma_i + (m_i - m) (m_i - m)')

(Bar-Shalom, Li, Kirubarajan, "Estimation with applications to tracking and navigation", 2001, section 1.4.16.)
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import torch
from jaxtyping import Float, Int, UInt8
from torch import Tensor

from nerfnav.estimator.core.belief import POSE, Belief, add_information, posterior_covariance
from nerfnav.estimator.core.filter_config import FastConfig
from nerfnav.estimator.core.filter_step import FilterOutcome, FilterResult, FilterStep, Innovation
from nerfnav.estimator.core.prediction import count_determined, estimate_noise_scale, scale_process_noise
from nerfnav.estimator.paper.cost import PoseCost, precision
from nerfnav.estimator.photometric.levenberg_marquardt import POSE as _POSE
from nerfnav.estimator.photometric.levenberg_marquardt import Iterate, Prior, join_information, picture_information
from nerfnav.estimator.photometric.pixel_selection import Hidden, PixelChoice, PixelSource
from nerfnav.estimator.photometric.pyramid import View
from nerfnav.estimator.photometric.residuals import Observation, count_patches
from nerfnav.geometry import Pose, so3
from nerfnav.robots import BODY_RATE, TANGENT, VELOCITY, ProcessNoise, RigidState

_CONSISTENT = 12.6
"""Normalised square of a move above which it hardly agrees with the prediction: chi-squared of six numbers, once in
20."""
_LEAST_SHARE = 0.01
"""Least share of the predicted variance that a picture is taken to explain, in any direction."""
_LARGEST = 50.0
"""Logarithm of odds beyond which the weaker hypothesis has no weight."""
_LEAST_DIRECTIONS = 3
"""Fewest directions of the six in which a picture must halve the variance to be more than WEAK."""
_MEDIAN = 0.888
"""Median of a pixel's difference (root mean square of three colours) in noise of standard deviation 1: (2.366 / 3)^0.5
of chi-squared of three numbers."""


@dataclass(frozen=True)
class UpdateProblem:
    """Prediction and picture of one update."""

    view: View
    """Field and camera."""
    config: FastConfig
    """Options of the filter."""
    prediction: Belief
    """Belief after the dynamics, which holds the process noise `noise`."""
    image: UInt8[Tensor, "height width 3"]
    """Picture of the camera."""
    generator: torch.Generator
    """Source of random draws."""
    noise: ProcessNoise | None = None
    """Process noise in the prediction, whose size is adapted; None: it is unknown."""
    trusted: bool = True
    """Count the prediction in the cost; False: start from it only."""
    hidden: Hidden | None = None
    """Pixels that are not compared; None: all may be."""

    def prior(self, pixels: int, halvings: int = 0) -> Prior:
        """Return the prior of a descent that compares so many pixels of a picture reduced by 2^halvings."""
        at = pixels, halvings
        if at not in self._priors:
            config, noise = self.config, self.config.color_noise
            kappa = config.pyramid.mistrust**-halvings / (self.correlated(pixels) * noise.std**2)
            slack = config.pyramid.misplaced * self.view.grain / noise.std
            self._priors[at] = Prior(self._information, self.prediction.mean.pose, kappa, slack)
        return self._priors[at]

    def correlated(self, pixels: int) -> float:
        """Return k: how many of so many pixels err alike."""
        return self.config.color_noise.alike_of(pixels, self.patches)

    def state(self, pose: Pose, change: Float[Tensor, "6"]) -> RigidState:
        """Return the state for a pose that is `change` away from the prediction: velocities follow by regression."""
        mean, change = self.prediction.mean, self._regression @ change
        velocity, body_rate = mean.velocity + change[VELOCITY], mean.body_rate + change[BODY_RATE]
        return RigidState(pose.position, velocity, pose.rotation, body_rate)

    @cached_property
    def patches(self) -> float:
        """Number of independent patches of the picture."""
        return count_patches(self.image, noise_std=self.config.color_noise.usual_std(self.view.levels[0]))

    @cached_property
    def pose_information(self) -> Float[Tensor, "6 6"]:
        """Inverse covariance of the predicted pose."""
        return precision(self.prediction.covariance[POSE][:, POSE])

    @cached_property
    def _priors(self) -> dict[tuple[int, int], Prior]:
        """Priors that were asked for, some thirty times in an update."""
        return {}

    @cached_property
    def _information(self) -> Float[Tensor, "8 8"]:
        """Inverse covariance of pose and exposure."""
        exposure_std = (self.config.gain_std, self.config.bias_std)
        return join_information(self.pose_information if self.trusted else None, exposure_std)

    @cached_property
    def _regression(self) -> Float[Tensor, "12 6"]:
        """Change of the whole state for a change of the pose; of the pose alone where the dynamics are not trusted."""
        if not self.trusted:
            return torch.eye(TANGENT)[:, POSE]
        covariance = self.prediction.covariance
        return torch.linalg.solve(covariance[POSE][:, POSE], covariance[POSE]).T


@dataclass(frozen=True)
class Selection:
    """Pixels that a descent compares."""

    observation: Observation
    """Pixels of the picture, reduced or at full size."""
    places: Int[Tensor, "m 2"]
    """The same pixels (u, v) at full size."""
    source: PixelSource | None = None
    """Origin of pixels at full size; None: drawn evenly from a reduced picture."""
    chosen: PixelChoice | None = None
    """All pixels chosen at full size, once an update has chosen them."""


@dataclass(frozen=True)
class Minimum:
    """End of a descent."""

    step: FilterStep
    """Estimate, cost and residuals."""
    selection: Selection
    """Compared pixels."""
    iterate: Iterate
    """Poses with their costs and curvatures."""
    information: Float[Tensor, "6 6"] | None = None
    """Information of the picture about the pose, measured over the uncertainty (see secant.py); None: that of the
    slopes at the pose."""


def is_doubtful(problem: UpdateProblem, minimum: Minimum) -> bool:
    """Return True where the colours differ by more than noise explains, in mean square or in the median."""
    config = problem.config
    bound = config.pyramid.search.doubt * config.color_noise.std
    return not _mean_square(problem, minimum) <= bound**2 or _median_exceeds(
        problem, minimum.step, config.residual_gate
    )


def correct(problem: UpdateProblem, minimum: Minimum, rival: Minimum | None = None) -> FilterResult:
    """Return the posterior, downgraded where the minimum is unexplained or has a rival.

    A doubtful minimum that hardly agrees with the prediction leaves it.
    """
    result = compute_posterior(problem, minimum)
    if result.outcome is FilterOutcome.DIVERGED:
        return result
    if is_doubtful(problem, minimum):
        unexplained = _median_exceeds(problem, minimum.step, _MEDIAN)  # not for the sake of a few
        if not normalise_move(problem, minimum) <= (_CONSISTENT if unexplained else problem.config.innovation_gate):
            return _weakened(result, problem.prediction)
        if unexplained:
            return downgrade_unexplained(result, problem.prediction)
    other = None if rival is None else compute_posterior(problem, rival)
    if other is None or other.outcome is FilterOutcome.DIVERGED:
        return result
    return merge_rival(result, other, information_ratio(problem, minimum))


@torch.no_grad()
def compute_posterior(problem: UpdateProblem, minimum: Minimum) -> FilterResult:
    """Return the posterior at a minimum (Laplace), or the prediction where the minimum fails a gate."""
    config, step = problem.config, minimum.step
    information, change = information_at(problem, minimum), minimum.iterate.change[0, _POSE]
    passes = step.process <= config.innovation_gate and not _median_exceeds(problem, step, config.residual_gate)
    if not information.isfinite().all():
        return FilterResult(problem.prediction, FilterOutcome.DIVERGED, step)
    innovation = _innovation(problem, minimum, information)
    if not passes:
        return FilterResult(problem.prediction, FilterOutcome.DIVERGED, step, innovation=innovation)
    adapted = _adapt_noise(problem, change, information)
    mean = step.mean if adapted is problem else adapted.state(step.mean.pose, change)
    prediction = adapted.prediction.covariance
    if config.exact_covariance:
        alike = information_ratio(problem, minimum) * problem.correlated(len(minimum.selection.observation.pixels))
        noise = replace(config.color_noise, alike=alike)
        seen = minimum.selection.observation.exposed(minimum.iterate.guess.exposure[0])
        hessian = PoseCost.of(seen, adapted.prediction, noise).hessian(mean)
    else:
        hessian = 2 * add_information(change[3:], precision(prediction), information)
    covariance, curvature = posterior_covariance(hessian, prediction)
    covariance = covariance + config.floor_at(problem.view.grain).covariance()
    root = torch.linalg.cholesky(prediction[POSE][:, POSE])
    halved = int((torch.linalg.eigvalsh(root.T @ information @ root) > 1).sum())
    outcome = FilterOutcome.UPDATED if halved >= _LEAST_DIRECTIONS else FilterOutcome.WEAK
    mean = replace(mean, rotation=so3.project(mean.rotation))
    return FilterResult(Belief(mean, covariance), outcome, replace(step, mean=mean), curvature, innovation)


def information_at(problem: UpdateProblem, minimum: Minimum) -> Float[Tensor, "6 6"]:
    """Return the information of the picture about the pose at a minimum."""
    if minimum.information is not None:
        return minimum.information
    return picture_information(minimum.iterate) / information_ratio(problem, minimum)


def downgrade_unexplained(result: FilterResult, prediction: Belief) -> FilterResult:
    """Return the posterior where no search explains the picture: the minimum is false as likely as not.

    The prediction then has half of the weight.
    """
    found = result.posterior
    away = found.mean.local(prediction.mean)
    covariance = 0.5 * (found.covariance + prediction.covariance) + 0.25 * torch.outer(away, away)
    mean = found.mean.retract(0.5 * away)
    return _weakened(result, Belief(replace(mean, rotation=so3.project(mean.rotation)), covariance))


def normalise_move(problem: UpdateProblem, minimum: Minimum) -> float:
    """Return the normalised square of the move from the predicted pose, chi-squared of six numbers.

    With P the covariance of that pose and I the picture's information, the move has the covariance P - (P^-1 + I)^-1
    (Bar-Shalom, Li, Kirubarajan 2001, section 5.4): a picture that tells little moves little. A false minimum does not
    keep to that.
    """
    root = torch.linalg.cholesky(problem.prediction.covariance[POSE][:, POSE].double())
    gains, axes = torch.linalg.eigh(root.T @ information_at(problem, minimum).double() @ root)
    move = axes.T @ torch.linalg.solve_triangular(root, minimum.iterate.change[0, _POSE].double()[:, None], upper=False)
    share = (gains / (1 + gains)).clamp_min(_LEAST_SHARE)
    return float((move[:, 0].square() / share).sum())


def merge_rival(result: FilterResult, rival: FilterResult, ratio: float) -> FilterResult:
    """Return the posterior where the picture does not rule out another minimum.

    Both have the likelihood of Laplace's approximation, exp(-J / 2) |Sigma|^(1 / 2), with the photometric part of J
    divided by `ratio`, how many times less the picture tells. The belief stays at the better minimum, with the second
    moment of both about it.
    """
    best, other = result.posterior, rival.posterior
    logs = [
        0.5 * float(end.posterior.covariance.double().logdet() - end.step.photometric / ratio - end.step.process)
        for end in (result, rival)
    ]
    share = 1 / (1 + math.exp(min(logs[0] - logs[1], _LARGEST)))
    away = best.mean.local(other.mean)
    moment = other.covariance + torch.outer(away, away)
    return replace(result, posterior=replace(best, covariance=(1 - share) * best.covariance + share * moment))


def _weakened(result: FilterResult, posterior: Belief) -> FilterResult:
    step = replace(result.step, mean=posterior.mean)
    return replace(result, posterior=posterior, outcome=FilterOutcome.WEAK, step=step)


def _median_exceeds(problem: UpdateProblem, step: FilterStep, deviations: float) -> bool:
    """Return True where most pixels differ by more than so many standard deviations of the noise."""
    return not step.residual.median().item() <= deviations * problem.config.color_noise.std


def _mean_square(problem: UpdateProblem, minimum: Minimum) -> float:
    """Return the mean square of the colours' differences (Huber)."""
    step, kappa = minimum.step, problem.prior(len(minimum.selection.observation.pixels)).kappa
    return step.photometric / kappa / step.residual.numel() / 3


def information_ratio(problem: UpdateProblem, minimum: Minimum) -> float:
    """Return how many times less a picture tells than held-out views do, by its own differences and its patches."""
    if not problem.config.adaptive:
        return 1.0
    return problem.config.color_noise.doubt(_mean_square(problem, minimum), problem.patches)


def _innovation(problem: UpdateProblem, minimum: Minimum, information: Float[Tensor, "6 6"]) -> Innovation:
    """Return the move of the pose by the picture."""
    config, std, step = problem.config, problem.config.color_noise.std, minimum.step
    exposure = minimum.iterate.guess.exposure[0] / torch.tensor([config.gain_std, config.bias_std])
    return Innovation(
        square=step.process,
        determined=count_determined(problem.pose_information, information),
        residual=step.residual.median().item() / (_MEDIAN * std),
        mean_square=_mean_square(problem, minimum) / std**2,
        exposure=exposure.abs().max().item(),
    )


def _adapt_noise(
    problem: UpdateProblem, change: Float[Tensor, "6"], information: Float[Tensor, "6 6"]
) -> UpdateProblem:
    """Return the problem with the process noise that the picture shows.

    The pose stays, for the prediction hardly moves it; its velocities follow.
    """
    if problem.noise is None or not problem.trusted or not problem.config.adaptive:
        return problem
    size = estimate_noise_scale(change, problem.pose_information, information, problem.config.noise_trust)
    return replace(problem, prediction=scale_process_noise(problem.prediction, problem.noise.covariance(), size))

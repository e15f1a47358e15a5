"""Posterior of a picture: test by the end of a descent whether it is usable, and downgrade the posterior if not.

Where two hypotheses remain, the posterior is one Gaussian of the mixture's moments,

    mean m = sum w_i m_i,   covariance sum w_i (Sigma_i + (m_i - m) (m_i - m)')

(Bar-Shalom, Li, Kirubarajan, "Estimation with applications to tracking and navigation", 2001, section 1.4.16.)
"""


import math
from dataclasses import dataclass, replace
from functools import cached_property

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.estimator.core.belief import Belief
from nerfnav.estimator.core.covariance import POSE, add_information, posterior_covariance
from nerfnav.estimator.core.filter_step import FilterOutcome, FilterStep
from nerfnav.estimator.core.prediction import estimate_noise_scale, scale_process_noise
from nerfnav.estimator.paper.cost import PoseCost, precision
from nerfnav.estimator.paper.pose_filter import FilterConfig
from nerfnav.estimator.photometric.levenberg_marquardt import POSE as _POSE
from nerfnav.estimator.photometric.levenberg_marquardt import Iterate, Prior, join_information, picture_information
from nerfnav.estimator.photometric.pyramid import View
from nerfnav.estimator.photometric.residuals import Observation, count_patches
from nerfnav.geometry import Pose, so3
from nerfnav.robots import BODY_RATE, TANGENT, VELOCITY, ProcessNoise, RigidState

_CONSISTENT = 12.6
"""Process term above which a minimum is hardly where the prediction says: chi-squared of six numbers, once in 20."""
_LARGEST = 50.0
"""Logarithm of odds beyond which there is nothing to share."""


def downgrade_unexplained(step: FilterStep, before: Belief) -> FilterStep:
    """The posterior where a search has found nothing that explains the picture: a false minimum, as likely as not.

    The picture is then as likely to have told what the minimum says as to have told nothing, so that the prediction
    `before` has half of the weight. A minimum where the prediction would hardly be is no such thing, and is left.
    """
    assert step.posterior is not None, "a concluded step has the posterior"
    found = step.posterior
    if step.process > _CONSISTENT:
        return replace(step, mean=before.mean, posterior=before, outcome=FilterOutcome.WEAK)
    away = found.mean.local(before.mean)
    covariance = 0.5 * (found.covariance + before.covariance) + 0.25 * torch.outer(away, away)
    mean = found.mean.retract(0.5 * away)
    mean = replace(mean, rotation=so3.project(mean.rotation))
    return replace(step, mean=mean, posterior=Belief(mean, covariance), outcome=FilterOutcome.WEAK)


def rivalled(step: FilterStep, rival: FilterStep, doubt: float) -> FilterStep:
    """The posterior where there is another minimum, which a picture of little does not rule out.

    Both are as likely as Laplace's approximation makes them, exp(-J / 2) |Sigma|^(1 / 2), with the photometric part of
    J divided by how many times less the picture tells, `doubt`. The belief stays at the better minimum, with the second
    moment of both about it.
    """
    assert step.posterior is not None and rival.posterior is not None, "concluded steps have posteriors"
    best, other = step.posterior, rival.posterior
    logs = [
        0.5 * float(belief.covariance.double().logdet() - end.photometric / doubt - end.process)
        for belief, end in ((best, step), (other, rival))
    ]
    share = 1 / (1 + math.exp(min(logs[0] - logs[1], _LARGEST)))
    away = best.mean.local(other.mean)
    moment = other.covariance + torch.outer(away, away)
    return replace(step, posterior=replace(best, covariance=(1 - share) * best.covariance + share * moment))


End = tuple[FilterStep, Observation, Iterate]
"""Where a descent is."""
_TOLD = 3
"""Fewest directions of the six in which a picture must halve the variance to be more than WEAK."""
_MEDIAN = 0.888
"""Median of a pixel's difference (root mean square of three colours) in noise of standard deviation 1: (2.366 / 3)^0.5
of chi-squared of three numbers."""


@dataclass
class Judge:
    """What judges the ends of one update's descents."""

    view: View
    """What looks at what."""
    config: FilterConfig
    """How it works."""
    trusted: bool
    """Whether the prediction counts in the cost."""
    prediction: Belief
    """Where the dynamics lead, with the process noise `noise` in it."""
    image: Tensor
    generator: torch.Generator
    noise: ProcessNoise | None = None

    def _prior(self, pixels: int, halvings: int = 0) -> Prior:
        config, noise = self.config, self.config.color_noise
        kappa = config.pyramid.mistrust**-halvings / (self._alike(pixels) * noise.std**2)
        slack = config.pyramid.misplaced * self.view.grain / noise.std
        return Prior(self._information, self.prediction.mean.pose, kappa, slack)

    @cached_property
    def _information(self) -> Float[Tensor, "8 8"]:
        """Of the pose and of the exposure."""
        return join_information(self._known if self.trusted else None, (self.config.gain_std, self.config.bias_std))

    @cached_property
    def _known(self) -> Float[Tensor, "6 6"]:
        """Inverse covariance of the predicted pose."""
        return precision(self.prediction.covariance[POSE][:, POSE])

    def _alike(self, pixels: int) -> float:  # k: how many of this many pixels err alike
        return self.config.color_noise.alike_of(pixels, self._patches)

    @cached_property
    def _patches(self) -> float:
        return count_patches(self.image, noise_std=self.config.color_noise.std)

    @cached_property
    def _regression(self) -> Float[Tensor, "12 6"]:
        """Change of the whole state for a change of the pose; of the pose alone where the dynamics are not trusted."""
        if not self.trusted:
            return torch.eye(TANGENT)[:, POSE]
        covariance = self.prediction.covariance
        return torch.linalg.solve(covariance[POSE][:, POSE], covariance[POSE]).T

    def _state(self, pose: Pose, change: Float[Tensor, "6"]) -> RigidState:
        """The whole state for a pose, which is `change` away from the prediction."""
        mean, change = self.prediction.mean, self._regression @ change
        velocity, body_rate = mean.velocity + change[VELOCITY], mean.body_rate + change[BODY_RATE]
        return RigidState(pose.position, velocity, pose.rotation, body_rate)

    def _is_doubtful(self, end: End) -> bool:
        """Whether the colours differ by more than noise explains, on the whole or mostly."""
        step, seen, _ = end
        bound = self.config.pyramid.search.doubt * self.config.color_noise.std
        return not self._squares(step, seen) <= bound**2 or self._disagrees(step)

    def _is_unexplained(self, end: End) -> bool:
        """Whether an end is doubtful, and not for the sake of a few pixels: most differ by more than noise has them."""
        return self._is_doubtful(end) and not end[0].residual.median().item() <= _MEDIAN * self.config.color_noise.std

    def _squares(self, step: FilterStep, seen: Observation) -> float:
        """Mean square of the colours' differences (Huber)."""
        return step.photometric / self._prior(len(seen.pixels)).kappa / step.residual.numel() / 3

    def _disagrees(self, step: FilterStep) -> bool:
        """Whether most pixels differ by more than noise explains."""
        config = self.config
        return not step.residual.median().item() <= config.residual_gate * config.color_noise.std

    @torch.no_grad()
    def _conclude(self, step: FilterStep, seen: Observation, here: Iterate) -> FilterStep:
        """The posterior at the minimum, or the prediction where the minimum is not to be believed."""
        config = self.config
        known = picture_information(here)
        if not step.process <= config.innovation_gate or self._disagrees(step) or not known.isfinite().all():
            return replace(step, posterior=self.prediction, outcome=FilterOutcome.DIVERGED)
        scale, change = self._doubt_of(step, seen), here.change[0, _POSE]
        known = known / scale
        step, prediction = self._adapted(step, change, known)
        if config.exact_covariance:
            noise = replace(config.color_noise, alike=scale * self._alike(len(seen.pixels)))
            curved = PoseCost.of(seen.exposed(here.guess.exposure[0]), prediction, noise).hessian(step.mean)
        else:
            curved = 2 * add_information(change[3:], precision(prediction.covariance), known)
        covariance, curvature = posterior_covariance(curved, prediction.covariance)
        covariance = covariance + config.floor_at(self.view.grain).covariance()
        root = torch.linalg.cholesky(prediction.covariance[POSE][:, POSE])
        gained = torch.linalg.eigvalsh(root.T @ known @ root) > 1
        outcome = FilterOutcome.UPDATED if int(gained.sum()) >= _TOLD else FilterOutcome.WEAK
        mean = replace(step.mean, rotation=so3.project(step.mean.rotation))
        return replace(step, mean=mean, posterior=Belief(mean, covariance), outcome=outcome, curvature=curvature)

    def _doubt_of(self, step: FilterStep, seen: Observation) -> float:
        """How many times less a picture tells than held-out views promise, by its own differences and its patches."""
        if not self.config.adaptive:
            return 1.0
        return self.config.color_noise.doubt(self._squares(step, seen), self._patches)

    def _adapted(
        self, step: FilterStep, change: Float[Tensor, "6"], known: Float[Tensor, "6 6"]
    ) -> tuple[FilterStep, Belief]:
        """The end of a descent and the prediction, as they are with the process noise that the picture shows.

        The pose stays, for the prediction hardly moves it; its velocities follow.
        """
        config, before = self.config, self.prediction
        if self.noise is None or not self.trusted or not config.adaptive:
            return step, before
        size = estimate_noise_scale(change, self._known, known, config.noise_trust)
        adapted = replace(self, prediction=scale_process_noise(before, self.noise.covariance(), size))
        return replace(step, mean=adapted._state(step.mean.pose, change)), adapted.prediction

    def _of_both(self, last: FilterStep, best: End, rival: End | None) -> FilterStep:
        """The posterior with what may be the case besides the best minimum."""
        if last.outcome is FilterOutcome.DIVERGED:
            return last
        if self._is_unexplained(best):
            return downgrade_unexplained(last, self.prediction)
        other = None if rival is None else self._conclude(*rival)
        if other is None or other.outcome is FilterOutcome.DIVERGED:
            return last
        return rivalled(last, other, self._doubt_of(best[0], best[1]))

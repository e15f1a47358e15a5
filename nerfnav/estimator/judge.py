"""What a picture says by where a descent has ended: whether that is to be believed, and the posterior."""

from dataclasses import dataclass, replace
from functools import cached_property

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.estimator.adaptive import noise_scale, with_noise_scaled
from nerfnav.estimator.belief import Belief
from nerfnav.estimator.cost import PoseCost, precision
from nerfnav.estimator.covariance import POSE, information_of, posterior_covariance
from nerfnav.estimator.filter import FilterConfig
from nerfnav.estimator.mixture import rivalled, unexplained
from nerfnav.estimator.newton import POSE as _POSE
from nerfnav.estimator.newton import Iterate, Prior, joined, picture_information
from nerfnav.estimator.noise import ProcessNoise
from nerfnav.estimator.photometric import Observation, patches
from nerfnav.estimator.pyramid import View
from nerfnav.estimator.steps import FilterOutcome, FilterStep
from nerfnav.geometry import Pose, so3
from nerfnav.robots import BODY_RATE, TANGENT, VELOCITY, RigidState

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
        return joined(self._known if self.trusted else None, (self.config.gain_std, self.config.bias_std))

    @cached_property
    def _known(self) -> Float[Tensor, "6 6"]:
        """Inverse covariance of the predicted pose."""
        return precision(self.prediction.covariance[POSE][:, POSE])

    def _alike(self, pixels: int) -> float:  # k: how many of this many pixels err alike
        return self.config.color_noise.alike_of(pixels, self._patches)

    @cached_property
    def _patches(self) -> float:
        return patches(self.image, noise_std=self.config.color_noise.std)

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
            curved = 2 * information_of(change[3:], precision(prediction.covariance), known)
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
        size = noise_scale(change, self._known, known, config.noise_trust)
        adapted = replace(self, prediction=with_noise_scaled(before, self.noise.covariance(), size))
        return replace(step, mean=adapted._state(step.mean.pose, change)), adapted.prediction

    def _of_both(self, last: FilterStep, best: End, rival: End | None) -> FilterStep:
        """The posterior with what may be the case besides the best minimum."""
        if last.outcome is FilterOutcome.DIVERGED:
            return last
        if self._is_unexplained(best):
            return unexplained(last, self.prediction)
        other = None if rival is None else self._conclude(*rival)
        if other is None or other.outcome is FilterOutcome.DIVERGED:
            return last
        return rivalled(last, other, self._doubt_of(best[0], best[1]))

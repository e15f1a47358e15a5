"""Paper's pose filter: predict by the dynamics, correct by one picture (paper Eqs. 3-8).

    predict -> select pixels -> align -> test -> correct

    mu+ = argmin over x of  |C(T) - I|^2 in S^-1  +  |x (-) mu-|^2 in (Sigma-)^-1,   Sigma+ = (Hessian / 2)^-1

Only the pose shows in a picture; velocity and body rate move through the prediction's cross-covariance.
"""

import dataclasses
import math
from collections.abc import Generator
from dataclasses import dataclass
from functools import partial

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.estimator.core.belief import Belief, posterior_covariance
from nerfnav.estimator.core.filter_config import PaperConfig
from nerfnav.estimator.core.filter_step import (
    FilterOutcome,
    FilterResult,
    FilterStep,
    FilterUpdate,
    is_usable,
    keep_prediction,
)
from nerfnav.estimator.core.prediction import predict
from nerfnav.estimator.paper.adam import descend
from nerfnav.estimator.paper.cost import CostTerms, PoseCost
from nerfnav.estimator.paper.retraction import Retraction, choose_retraction, princeton_lietorch
from nerfnav.estimator.photometric.pixel_selection import PixelSource, choose_pixels
from nerfnav.estimator.photometric.residuals import FieldCamera, Observation, difference
from nerfnav.field import Field
from nerfnav.geometry import FORWARD_MOUNT, Camera, Pose, check_image
from nerfnav.robots import TANGENT, ProcessNoise, RigidState, Robot


@dataclass(frozen=True)
class PoseFilter:
    """Estimator that compares a picture with the field."""

    field: Field
    """Map."""
    robot: Robot
    """Dynamics of the prediction."""
    camera: Camera
    """Camera of the pictures."""
    mount: Pose = FORWARD_MOUNT
    """T_body_camera."""
    config: PaperConfig = dataclasses.field(default_factory=PaperConfig)
    """Options."""
    retraction: Retraction = dataclasses.field(default_factory=lambda: choose_retraction(princeton_lietorch()))
    """Retraction of the mean onto the manifold."""

    def update(
        self, belief: Belief, image: Tensor | None, action: Float[Tensor, " a"], dt: float, generator: torch.Generator
    ) -> FilterUpdate:
        """Predict over an action of `dt` [s], and correct by the picture (uint8, height x width x 3) taken then.

        Yields a step for every iteration; returns the posterior. Raises InvalidInputError for a picture of another
        camera.
        """
        noise = self.config.process_noise
        return self.correct(predict(belief, action, self.robot, dt, noise), image, generator, noise)

    @property
    def trust_dynamics(self) -> bool:
        """True: the prediction counts."""
        return True

    def correct(
        self, prediction: Belief, image: Tensor | None, generator: torch.Generator, noise: ProcessNoise | None = None
    ) -> FilterUpdate:
        """Correct a prediction by a picture; the size of its process `noise` does not matter.

        Yields, returns and raises as `update` does.
        """
        if image is None:
            return keep_prediction(prediction)
        check_image(image, self.camera)
        return self._correct(prediction, image, generator)

    def _correct(self, prediction: Belief, image: Tensor, generator: torch.Generator) -> FilterUpdate:
        """Select pixels, align, test (and align again from elsewhere where it fails), and correct."""
        view, config = FieldCamera(self.field, self.camera, self.mount), self.config
        choice = choose_pixels(image, config.pixels, generator, partial(Observation.slopes, prediction.mean.pose, view))
        cost = PoseCost.of(Observation.of(image, choice.pixels, view), prediction, config.color_noise)
        if not is_usable(image, config.least_contrast):
            with torch.no_grad():
                step = _record(0, prediction.mean, cost.terms(prediction.mean), cost, choice.source)
            yield step
            return FilterResult(prediction, FilterOutcome.PREDICTED_ONLY, step)
        step = yield from self._align(cost, prediction.mean, choice.source)
        for _ in range(config.retries):
            if not math.isfinite(step.photometric) or not self._disagrees(step):
                break
            step = yield from self._align(cost, self._likeliest(cost, generator), choice.source, step.iteration + 1)
        if not math.isfinite(step.photometric):
            outcome = FilterOutcome.DIVERGED if step.iteration else FilterOutcome.PREDICTED_ONLY
            return FilterResult(prediction, outcome, step)
        result = self._conclude(step, cost)
        yield step
        return result

    def _align(
        self, cost: PoseCost, start: RigidState, source: PixelSource, iteration: int = 0
    ) -> Generator[FilterStep, None, FilterStep]:
        """Descend from a start; ends where the cost is not finite."""
        descent = descend(cost, start, self.config.descent, self.retraction)
        state, terms = next(descent)
        while True:
            step = _record(iteration, state, terms, cost, source)
            yield step
            later = next(descent, None) if math.isfinite(step.photometric) else None
            if later is None:
                return step
            (state, terms), iteration = later, iteration + 1

    def _conclude(self, step: FilterStep, cost: PoseCost) -> FilterResult:
        """Return the posterior at a minimum, or the prediction where the minimum fails a gate."""
        rejected = FilterResult(cost.prediction, FilterOutcome.DIVERGED, step)
        if step.process > self.config.innovation_gate or self._disagrees(step):
            return rejected
        curved = cost.hessian(step.mean)
        if not curved.isfinite().all():
            return rejected
        covariance, curvature = posterior_covariance(curved, cost.prediction.covariance)
        return FilterResult(Belief(step.mean, covariance), FilterOutcome.UPDATED, step, curvature)

    def _disagrees(self, step: FilterStep) -> bool:
        """Return True where most pixels differ by more than noise explains."""
        return step.residual.median().item() > self.config.residual_gate * self.config.color_noise.std

    @torch.no_grad()
    def _likeliest(self, cost: PoseCost, generator: torch.Generator) -> RigidState:
        """Return the random state of the prediction from which the field looks most like the picture."""
        prediction = cost.prediction
        root = torch.linalg.cholesky(prediction.covariance)
        draws = torch.randn(self.config.candidates, TANGENT, generator=generator) @ root.T
        states = [prediction.mean.retract(draw) for draw in draws]
        return min(states, key=lambda state: difference(cost.observation.residual(state)).mean().item())


def _record(iteration: int, state: RigidState, terms: CostTerms, cost: PoseCost, source: PixelSource) -> FilterStep:
    return FilterStep(
        iteration,
        state,
        terms.photometric.item(),
        terms.process.item(),
        cost.observation.pixels,
        difference(terms.residual.detach()),
        believed=terms.believed,
        pixel_source=source,
    )

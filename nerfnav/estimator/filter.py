"""The paper's pose filter: predict by the dynamics, correct by one picture (paper Eqs. 3-8).

    mu+ = argmin over x of  |C(T) - I|^2 in S^-1  +  |x (-) mu-|^2 in (Sigma-)^-1,   Sigma+ = (Hessian / 2)^-1

Only the pose shows in a picture; velocity and body rate move through the prediction's cross-covariance.
"""

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from nerfnav.errors import InvalidInputError
from nerfnav.estimator.belief import Belief
from nerfnav.estimator.cost import CostTerms, PoseCost
from nerfnav.estimator.covariance import posterior_covariance
from nerfnav.estimator.descent import DescentConfig, descend
from nerfnav.estimator.noise import StateNoise
from nerfnav.estimator.photometric import ColorNoise, Observation, difference
from nerfnav.estimator.pixels import PixelConfig, PixelSource, choose_pixels
from nerfnav.estimator.predict import predict
from nerfnav.estimator.retraction import Retraction, choose_retraction, princeton_lietorch
from nerfnav.estimator.steps import FilterOutcome, FilterStep
from nerfnav.field.field import Field
from nerfnav.geometry.camera import FORWARD_MOUNT, Camera, Pose
from nerfnav.robots.robot import Robot
from nerfnav.robots.state import RigidState


@dataclass(frozen=True)
class FilterConfig:
    """How the filter works. The defaults are matched to the simulator; `paper()` is the paper's choice."""

    pixels: PixelConfig = dataclasses.field(default_factory=PixelConfig)
    """Which pixels are compared."""
    descent: DescentConfig = dataclasses.field(default_factory=DescentConfig)
    """How the cost is minimised."""
    process_noise: StateNoise = dataclasses.field(default_factory=StateNoise)
    """Q, the noise that each time step adds (paper: 0.1 I, far more than its simulator's 2 cm, 0.02 rad)."""
    color_noise: ColorNoise = dataclasses.field(default_factory=ColorNoise)
    """S, the measurement noise; its `std` should be the field's own, see `for_field`."""
    innovation_gate: float = 80.0
    """DIVERGED when the process term ends above this (chi-squared of 12 numbers: above 39 once in 10,000)."""
    residual_gate: float = 4.0
    """DIVERGED when the median difference ends above this many standard deviations of the noise."""
    least_contrast: int = 4
    """A picture whose colours differ by less than this says nothing [levels of 255]."""

    @classmethod
    def paper(cls) -> "FilterConfig":
        """The paper's numbers: 300 steps without early stop, 256 pixels, Q = 0.1 I."""
        return cls(descent=DescentConfig(stop_change=None), process_noise=StateNoise.isotropic(0.1))

    def for_field(self, noise_std: float | None) -> "FilterConfig":
        """The same with the noise that was measured for a field (`field.info.noise_std`); None changes nothing."""
        if noise_std is None:
            return self
        return replace(self, color_noise=replace(self.color_noise, std=noise_std))


@dataclass(frozen=True)
class PoseFilter:
    """An estimator that compares a picture with what the field shows."""

    field: Field
    """The map."""
    robot: Robot
    """Its dynamics predict."""
    camera: Camera
    """What takes the pictures."""
    mount: Pose = FORWARD_MOUNT
    """T_body_camera."""
    config: FilterConfig = dataclasses.field(default_factory=FilterConfig)
    """How it works."""
    retraction: Retraction = dataclasses.field(
        default_factory=lambda: choose_retraction(princeton_lietorch())
    )
    """What brings the mean back onto the manifold."""

    def update(
        self,
        belief: Belief,
        image: Tensor,
        action: Float[Tensor, " a"],
        dt: float,
        generator: torch.Generator,
    ) -> Iterator[FilterStep]:
        """The belief after an action of `dt` [s] and the picture (uint8, height x width x 3) taken then.

        Yields a step for every iteration; the last one carries the posterior and the outcome. Raises
        InvalidInputError where the picture is not one of this camera.
        """
        check_image(image, self.camera)
        prediction = predict(belief, action, self.robot, dt, self.config.process_noise)
        choice = choose_pixels(image, self.config.pixels, generator)
        observation = Observation.of(image, choice.pixels, (self.field, self.camera, self.mount))
        config = self.config
        cost = PoseCost.of(observation, prediction, config.color_noise)
        says_something = contrast(image) >= config.least_contrast
        return self._correct(cost, choice.source, says_something)

    def _correct(self, cost: PoseCost, source: PixelSource, says_something: bool) -> Iterator[FilterStep]:
        """Go down the cost; the last step repeats the last iteration, with the posterior."""
        prediction = cost.prediction
        states = descend(cost, prediction.mean, self.config.descent, self.retraction)
        step = _record(0, *next(states), cost, source)
        if not (says_something and math.isfinite(step.photometric)):
            yield replace(step, posterior=prediction, outcome=FilterOutcome.PREDICTED_ONLY)
            return
        yield step
        for iteration, (state, terms) in enumerate(states, 1):
            step = _record(iteration, state, terms, cost, source)
            if not math.isfinite(step.photometric):
                yield replace(step, posterior=prediction, outcome=FilterOutcome.DIVERGED)
                return
            yield step
        yield self._conclude(step, cost)

    def _conclude(self, step: FilterStep, cost: PoseCost) -> FilterStep:
        """The posterior at the minimum, or the prediction where the minimum is not to be believed."""
        curved = cost.hessian(step.mean)
        covariance, curvature = posterior_covariance(curved, cost.prediction.covariance)
        surprise = step.residual.median().item() / self.config.color_noise.std
        if (
            step.process > self.config.innovation_gate
            or surprise > self.config.residual_gate
            or not covariance.isfinite().all()
        ):
            return replace(step, posterior=cost.prediction, outcome=FilterOutcome.DIVERGED)
        posterior = Belief(step.mean, covariance)
        return replace(step, posterior=posterior, outcome=FilterOutcome.UPDATED, curvature=curvature)


def check_image(image: Tensor, camera: Camera) -> None:
    """Raise InvalidInputError unless `image` is a uint8 RGB picture of the camera's size."""
    wanted = (camera.height, camera.width, 3)
    if image.dtype != torch.uint8 or tuple(image.shape) != wanted:
        raise InvalidInputError(
            f"this camera takes uint8 pictures of {wanted[0]} x {wanted[1]} x 3 (height x width x RGB), not "
            f" {str(image.dtype).removeprefix('torch.')} of {' x '.join(map(str, image.shape))}"
        )


def contrast(image: UInt8[Tensor, "height width 3"]) -> int:
    """The largest difference of two pixels in one channel [levels of 255]."""
    flat = image.reshape(-1, 3).int()
    return int((flat.amax(0) - flat.amin(0)).max())


def _record(
    iteration: int, state: RigidState, terms: CostTerms, cost: PoseCost, source: PixelSource
) -> FilterStep:
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

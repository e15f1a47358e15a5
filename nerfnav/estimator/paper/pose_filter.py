"""The paper's pose filter: predict by the dynamics, correct by one picture (paper Eqs. 3-8).

    mu+ = argmin over x of  |C(T) - I|^2 in S^-1  +  |x (-) mu-|^2 in (Sigma-)^-1,   Sigma+ = (Hessian / 2)^-1

Only the pose shows in a picture; velocity and body rate move through the prediction's cross-covariance.
"""

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.estimator.core.belief import Belief
from nerfnav.estimator.core.covariance import posterior_covariance
from nerfnav.estimator.core.filter_step import FilterOutcome, FilterStep, measure_contrast, predicted_only
from nerfnav.estimator.core.prediction import predict
from nerfnav.estimator.paper.adam import DescentConfig, descend
from nerfnav.estimator.paper.cost import CostTerms, PoseCost
from nerfnav.estimator.paper.retraction import Retraction, choose_retraction, princeton_lietorch
from nerfnav.estimator.photometric.pixel_selection import PixelConfig, PixelSource, choose_pixels
from nerfnav.estimator.photometric.pyramid import PyramidConfig
from nerfnav.estimator.photometric.residuals import ColorNoise, Observation, difference
from nerfnav.field import Field, FieldInfo
from nerfnav.geometry import FORWARD_MOUNT, Camera, Pose, check_image
from nerfnav.robots import TANGENT, ProcessNoise, RigidState, Robot, StateNoise


@dataclass(frozen=True)
class FilterConfig:
    """How the filter works. The defaults are matched to the simulator; `paper()` is the paper's choice."""

    pixels: PixelConfig = dataclasses.field(default_factory=PixelConfig)
    """Which pixels are compared."""
    descent: DescentConfig = dataclasses.field(default_factory=DescentConfig)
    """How the paper's filter minimises the cost."""
    pyramid: PyramidConfig = dataclasses.field(default_factory=PyramidConfig)
    """How the fast filter does."""
    floor: StateNoise = dataclasses.field(default_factory=lambda: StateNoise(0.0005, 0.0, 0.0005, 0.0))
    """What no picture improves upon, for field and camera are never quite what they are taken for (fast filter)."""
    grain: float = 0.055
    """The same for the position as a share of the distance of the field's nodes, where that is more and nobody measured
    it (see `for_field`): a field learned from photographs puts its surfaces no more exactly, and errs alike in picture
    after picture (fast filter)."""
    exact_covariance: bool = False
    """Whether the fast filter takes the exact Hessian (paper) where Gauss-Newton's is at hand."""
    gain_std: float = 0.1
    """How far a picture's gain may be from the photographs' that the field learned from (fast filter; paper: 0)."""
    bias_std: float = 0.05
    """The same for a constant added to its colours [1 = full scale] (fast filter; paper: 0)."""
    process_noise: StateNoise = dataclasses.field(default_factory=StateNoise)
    """Q, the noise that each time step adds (paper: 0.1 I, far more than its simulator's 2 cm, 0.02 rad)."""
    adaptive: bool = True
    """Whether the sizes of Q and S are adapted to what each picture shows (fast filter, see prediction.py; paper:
    no)."""
    noise_trust: float = 1.5
    """How well Q's size is known beforehand where it is adapted: degrees of freedom."""
    color_noise: ColorNoise = dataclasses.field(default_factory=ColorNoise)
    """S, the measurement noise; its `std` should be the field's own, see `for_field`."""
    innovation_gate: float = 80.0
    """DIVERGED when the process term ends above this (chi-squared of 12 numbers: above 39 once in 10,000)."""
    residual_gate: float = 2.0
    """DIVERGED when the median difference ends above this many standard deviations of the noise."""
    retries: int = 2
    """Where most pixels disagree in the end, descend again this often (paper: 0): details in a picture are finer
    than a kick of 5 cm, so some descents end in a false minimum, which shows in the residual."""
    candidates: int = 64
    """Random states of the prediction, of which a further descent starts at the best."""
    least_contrast: int = 4
    """A picture whose colours differ by less than this says nothing [levels of 255]."""

    @classmethod
    def paper(cls) -> "FilterConfig":
        """The paper's numbers: 300 steps without early stop, 256 pixels, Q = 0.1 I."""
        return cls(process_noise=StateNoise.isotropic(0.1), adaptive=False, retries=0)

    def floor_at(self, grain: float) -> StateNoise:
        """What no picture improves upon in a field whose nodes are `grain` [m] apart."""
        return replace(self.floor, position_m=max(self.floor.position_m, self.grain * grain))

    def for_field(self, info: FieldInfo) -> "FilterConfig":
        """The same with what was measured of a field; what was not stays as it is, and so does a floor of one's own."""
        known, usual = replace(self, color_noise=self.color_noise.measured(info.noise_std)), FilterConfig()
        if info.position_floor_m is None or (self.floor, self.grain) != (usual.floor, usual.grain):
            return known
        return replace(known, floor=replace(self.floor, position_m=info.position_floor_m), grain=0.0)


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
        image: Tensor | None,
        action: Float[Tensor, " a"],
        dt: float,
        generator: torch.Generator,
    ) -> Iterator[FilterStep]:
        """The belief after an action of `dt` [s] and the picture (uint8, height x width x 3) taken then, if any.

        Yields a step for every iteration; the last one carries the posterior and the outcome. Raises
        InvalidInputError where the picture is not one of this camera.
        """
        noise = self.config.process_noise
        return self.correct(predict(belief, action, self.robot, dt, noise), image, generator, noise)

    @property
    def trust_dynamics(self) -> bool:
        """The prediction counts."""
        return True

    def correct(
        self, prediction: Belief, image: Tensor | None, generator: torch.Generator, noise: ProcessNoise | None = None
    ) -> Iterator[FilterStep]:
        """The same for a belief that the dynamics have moved already; how much `noise` they added does not matter.

        Raises as `update` does.
        """
        if image is None:
            return iter([predicted_only(prediction)])
        check_image(image, self.camera)
        view = (self.field, self.camera, self.mount)
        slopes = partial(Observation.slopes, prediction.mean.pose, view)
        choice = choose_pixels(image, self.config.pixels, generator, slopes)
        observation = Observation.of(image, choice.pixels, view)
        cost = PoseCost.of(observation, prediction, self.config.color_noise)
        if measure_contrast(image) < self.config.least_contrast:
            return iter([self._without_picture(cost, choice.source)])
        return self._correct(cost, choice.source, generator)

    def _correct(
        self, cost: PoseCost, source: PixelSource, generator: torch.Generator
    ) -> Iterator[FilterStep]:
        """Go down the cost, again from elsewhere where that ends in a false minimum.

        The last step repeats the last iteration, with the posterior.
        """
        start, iteration, step = cost.prediction.mean, 0, None
        for attempt in range(self.config.retries + 1):
            start = start if attempt == 0 else self._likeliest(cost, generator)
            for state, terms in descend(cost, start, self.config.descent, self.retraction):
                step = _record(iteration, state, terms, cost, source)
                if not math.isfinite(step.photometric):
                    nothing = FilterOutcome.PREDICTED_ONLY if iteration == 0 else FilterOutcome.DIVERGED
                    yield replace(step, posterior=cost.prediction, outcome=nothing)
                    return
                yield step
                iteration += 1
            assert step is not None, "a descent yields at least its start"
            if attempt == self.config.retries or not self._disagrees(step):
                yield self._conclude(step, cost)
                return

    def _conclude(self, step: FilterStep, cost: PoseCost) -> FilterStep:
        """The posterior at the minimum, or the prediction where the minimum is not to be believed."""
        if step.process > self.config.innovation_gate or self._disagrees(step):
            return replace(step, posterior=cost.prediction, outcome=FilterOutcome.DIVERGED)
        curved = cost.hessian(step.mean)
        if not curved.isfinite().all():
            return replace(step, posterior=cost.prediction, outcome=FilterOutcome.DIVERGED)
        covariance, curvature = posterior_covariance(curved, cost.prediction.covariance)
        posterior = Belief(step.mean, covariance)
        return replace(step, posterior=posterior, outcome=FilterOutcome.UPDATED, curvature=curvature)

    def _disagrees(self, step: FilterStep) -> bool:
        """Whether most pixels differ by more than noise explains."""
        return step.residual.median().item() > self.config.residual_gate * self.config.color_noise.std

    @torch.no_grad()
    def _likeliest(self, cost: PoseCost, generator: torch.Generator) -> RigidState:
        """Of random states of the prediction, the one from which the field looks most like the picture."""
        prediction = cost.prediction
        root = torch.linalg.cholesky(prediction.covariance)
        draws = torch.randn(self.config.candidates, TANGENT, generator=generator) @ root.T
        states = [prediction.mean.retract(draw) for draw in draws]
        return min(states, key=lambda state: difference(cost.observation.residual(state)).mean().item())

    @torch.no_grad()
    def _without_picture(self, cost: PoseCost, source: PixelSource) -> FilterStep:
        """The prediction as posterior."""
        prediction = cost.prediction
        step = _record(0, prediction.mean, cost.terms(prediction.mean), cost, source)
        return replace(step, posterior=prediction, outcome=FilterOutcome.PREDICTED_ONLY)


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

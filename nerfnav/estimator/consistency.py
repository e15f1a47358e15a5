"""Consistency monitor: the size of the process noise and of the residuals, estimated while a robot moves.

With a filter whose models are right, the move d of the pose by a picture has

    E[d' (Sigma-_TT)^-1 d] = n,   n = tr H (H + (Sigma-_TT)^-1)^-1

(normalised innovation squared; Sigma-_TT the predicted pose's covariance, H the picture's information, n the numbers
of the pose that it determines). Almost all of Sigma-_TT is the process noise of one step, so that the ratio of both
sides, times the square of the factor that was on Q's standard deviations, estimates the square of the right one. Sums
of both sides with exponential forgetting (Akhlaghi, Zhou and Huang 2017), from a prior of one picture that
agrees, give the factor f:

    b = l b + f^2 d' (Sigma-_TT)^-1 d,   a = l a + n,   l = exp(-n / (6 `memory`)),   estimate = (b / a)^0.5

A picture is forgotten by what later ones tell, so that a robot that sees nothing keeps what it has found. The factor is
on the prediction, before any gate. Within `tolerated` it is 1: flights by the right model stay as they are. A picture
counts for no more than `most` times n, for its minimum may be another one, and where its residual is not that of the
right place, it does not count. With Q's standard deviations in fact g times as large, b / g^2 is chi-squared of about a
numbers: the noise model is named where a factor of `named` is too near to 1 to explain b, at the level `level`.
"""

import math
from collections.abc import Generator
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

import scipy
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.estimator.core.belief import POSE, Belief
from nerfnav.estimator.core.filter_step import (
    Corrector,
    Estimator,
    FilterOutcome,
    FilterResult,
    FilterStep,
    FilterUpdate,
    Masked,
    Predictor,
)
from nerfnav.estimator.photometric.pixel_selection import Hidden
from nerfnav.robots import ProcessNoise

REMEDY = "add texture, light or an inertial unit, or fly higher"
"""Remedy where there is too little to see."""


class Cause(Enum):
    """Probable cause of an inconsistent or blind filter; the value is the user's text."""

    TOO_LITTLE_TO_SEE = (
        f"the last pictures left {{left:.0f}} % of the variance of the robot's pose, too little to see: {REMEDY}"
    )
    EXPOSURE = "the camera's exposure is not that of the field's photographs: fix the exposure"
    CAMERA_OR_FIELD = (
        "the pictures differ {residual:.2g} times as much from the field as its own photographs: check the camera's "
        "calibration, or train a finer field"
    )
    FIELD = (
        "the last pictures differ {residual:.2g} times as much from the field as its own photographs, the first ones "
        "did not: the field is too coarse here, train a finer one"
    )
    MOVED_SCENE = "parts of the pictures do not show the field: the scene has changed, so train it again"
    NOISE_MODEL = "the robot is moved {factor:.2g} times as much as the noise model says: correct its process noise"


@dataclass(frozen=True)
class ConsistencyConfig:
    """Options of the monitor."""

    memory: float = 8.0
    """Pictures, which determine the whole pose, after which one counts 1 / e as much."""
    most: float = 9.0
    """A picture's squares, of its move and of its residuals, count for no more than this many times their
    expectation."""
    range: float = 10.0
    """Largest factor on Q's standard deviations; its inverse is the least."""
    tolerated: tuple[float, float] = (0.55, 1.5)
    """Estimates between these change nothing; a robot on wheels is moved in half of its numbers alone, which gives 0.7.
    """
    named: float = 3.0
    """Factors beyond this, and below its inverse, are reported."""
    level: float = 0.01
    """Largest probability of what is reported of the noise, if the factor were `named`, or its inverse."""
    fewest: int = 8
    """Fewest compared pictures before anything is reported of them, and number of the first ones."""
    left: float = 0.5
    """Mean share of the pose's variance that pictures leave, from which there is too little to see: fewer than three of
    the six numbers show."""
    sure_m: float = 0.04
    """Standard deviation of a coordinate of the position up to which a robot needs to see no more [m]; with an inertial
    unit, or little noise, pictures of anything leave most of a small variance."""
    residual: float = 1.5
    """Mean of the residuals' ratio from which they are reported."""
    exposure: float = 2.0
    """The same of gain and bias, in standard deviations."""
    partial: float = 3.0
    """Mean square of residuals from which parts of the pictures differ, not all of them, in units of r^2 or of 1 / r^2
    with r the median, whichever is more: where r is under 1, the field's own noise is in few of the pixels."""


@dataclass(frozen=True)
class Consistency:
    """State of the monitor after an update."""

    observed: float = 6.0
    """b, in units of the given Q."""
    expected: float = 6.0
    """a."""
    pictures: int = 0
    """Compared pictures so far."""
    left: float = 0.0
    """Running mean of the share of the pose's variance that pictures left, 1 - n / 6; 0 where the robot is sure."""
    first: float = 0.0
    """Mean of the residuals' ratio in the first `fewest` pictures."""
    residual: float = 1.0
    """Running mean of the median residuals over the field's own."""
    mean_square: float = 1.0
    """Running mean of the residuals' mean squares over the field's own."""
    exposure: float = 0.0
    """Running mean of gain and bias, in standard deviations."""
    config: ConsistencyConfig = ConsistencyConfig()
    """Options."""

    @property
    def estimate(self) -> float:
        """Factor by which Q's standard deviations are too small."""
        most = self.config.range
        return min(max(math.sqrt(self.observed / self.expected), 1 / most), most)

    @property
    def noise_factor(self) -> float:
        """Factor on Q's standard deviations in the next prediction."""
        least, most = self.config.tolerated
        return 1.0 if least <= self.estimate <= most else self.estimate

    @property
    def cause(self) -> Cause | None:
        """Probable cause of an inconsistency, or of blindness; None while there is none.

        Where pictures tell little, what they differ by tells nothing of camera and scene.
        """
        config, scale = self.config, max(self.residual, 1 / max(self.residual, 1e-3))
        if self.left > config.left:
            return Cause.TOO_LITTLE_TO_SEE
        if self.pictures < config.fewest:
            return None
        if self.exposure > config.exposure:
            return Cause.EXPOSURE
        if self.residual > config.residual:
            return Cause.CAMERA_OR_FIELD if self.first > config.residual else Cause.FIELD
        if self.mean_square > config.partial * scale**2:
            return Cause.MOVED_SCENE
        return Cause.NOISE_MODEL if self._is_noise_wrong() else None

    def _is_noise_wrong(self) -> bool:
        """Test both factors of `named`: whether b is beyond what either explains, in its own direction."""
        named, level, shape = self.config.named, self.config.level, 0.5 * self.expected
        low, high = (float(scipy.special.gammainc(shape, 0.5 * self.observed / f**2)) for f in (1 / named, named))
        return low < level or high > 1 - level

    @property
    def sentence(self) -> str | None:
        """Cause for the user."""
        if self.cause is None:
            return None
        return self.cause.value.format(factor=self.estimate, residual=self.residual, left=100 * self.left)

    @property
    def numbers(self) -> dict[str, Any]:
        """Numbers of `consistency` in `fly --json`."""
        cause = None if self.cause is None else self.cause.name.lower()
        return {
            "cause": cause, "sentence": self.sentence, "noise_factor": self.estimate, "residual": self.residual,
            "pictures": self.pictures,
        }  # fmt: skip

    def after(self, result: FilterResult, placed: bool = True) -> "Consistency":
        """Return the state after an update by a picture, whose prediction held `noise_factor`.

        A robot that is not `placed` may be anywhere: its pictures differ whatever is right, and only what they leave
        counts.
        """
        seen, config = result.innovation, self.config
        if seen is None and result.outcome is not FilterOutcome.PREDICTED_ONLY:
            return self
        shown, faded = 0.0 if seen is None else seen.determined / len(POSE), math.exp(-1 / config.memory)
        missed = 0.0 if result.posterior.position_std <= config.sure_m else 1 - shown
        left = faded * self.left + (1 - faded) * missed
        if seen is None or not placed:
            return replace(self, left=left)
        keep, explained = math.exp(-shown / config.memory), seen.residual <= config.residual
        square = self.noise_factor**2 * min(seen.square, config.most * seen.determined)
        return replace(
            self,
            observed=keep * self.observed + square if explained else self.observed,
            expected=keep * self.expected + seen.determined if explained else self.expected,
            pictures=self.pictures + 1,
            left=left,
            first=self.first + (seen.residual / config.fewest if self.pictures < config.fewest else 0.0),
            residual=keep * self.residual + (1 - keep) * seen.residual,
            mean_square=keep * self.mean_square + (1 - keep) * min(seen.mean_square, config.most),
            exposure=keep * self.exposure + (1 - keep) * seen.exposure,
        )


def update_consistently(
    estimator: Estimator,
    belief: Belief,
    image: Tensor | None,
    action: Float[Tensor, " a"],
    dt: float,
    generator: torch.Generator,
    consistency: Consistency,
    hidden: Hidden | None = None,
) -> Generator[FilterStep, None, FilterResult]:
    """Update as `estimator.update` does, with the process noise that was found so far, where the estimator takes it,
    and without the pixels that are `hidden`, where it takes these."""
    if not isinstance(estimator, Predictor):
        return (yield from estimator.update(belief, image, action, dt, generator))
    prediction, noise = estimator.predict(belief, action, dt, consistency.noise_factor)
    return (yield from correct_masked(estimator, prediction, image, generator, noise, hidden))


def correct_masked(
    estimator: Corrector,
    prediction: Belief,
    image: Tensor | None,
    generator: torch.Generator,
    noise: ProcessNoise | None = None,
    hidden: Hidden | None = None,
) -> FilterUpdate:
    """Correct as `estimator.correct` does, without the pixels that are `hidden`, where it takes these."""
    masked = None if hidden is None else _as_masked(estimator)
    if masked is not None:
        return (yield from masked.correct(prediction, image, generator, noise, hidden))
    return (yield from estimator.correct(prediction, image, generator, noise))


def _as_masked(estimator: object) -> Masked | None:
    return estimator if isinstance(estimator, Masked) else None

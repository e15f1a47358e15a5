"""Consistency monitor: the size of the process noise and of the residuals, estimated while a robot moves.

With a filter whose models are right, the move d of the pose by a picture has

    E[d' (Sigma-_TT)^-1 d] = n,   n = tr H (H + (Sigma-_TT)^-1)^-1

(normalised innovation squared; Sigma-_TT the predicted pose's covariance, H the picture's information, n the numbers
of the pose that it determines). Almost all of Sigma-_TT is the process noise of one step, so that the ratio of both
sides, times the square of the factor that was on Q's standard deviations, estimates the square of the right one. Sums
of both sides with exponential forgetting (Akhlaghi, Zhou and Huang 2017), from a prior of one picture that
agrees, give the factor f:

    b = l b + f^2 d' (Sigma-_TT)^-1 d,   a = l a + n,   estimate = (b / a)^0.5

The factor is on the prediction, before any gate. Within `tolerated` it is 1: flights by the right model stay as
they are. A picture counts for no more than `most` times n, for its minimum may be another one, and where its residual
is not that of the right place, it does not count.
"""

import math
from collections.abc import Generator
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.estimator.core.belief import Belief
from nerfnav.estimator.core.filter_step import Estimator, FilterResult, FilterStep, Predictor


class Cause(Enum):
    """Probable cause of an inconsistent filter; the value is the user's text."""

    NOISE_MODEL = "the robot is moved {factor:.2g} times as much as the noise model says: correct its process noise"
    EXPOSURE = "the camera's exposure is not that of the field's photographs: fix the exposure"
    MOVED_SCENE = "parts of the pictures do not show the field: the scene has changed, so train it again"
    CAMERA_OR_FIELD = (
        "the pictures differ {residual:.2g} times as much from the field as its own photographs: check the camera's "
        "calibration, or train a finer field"
    )


@dataclass(frozen=True)
class ConsistencyConfig:
    """Options of the monitor."""

    memory: float = 8.0
    """Pictures after which one counts 1 / e as much."""
    most: float = 9.0
    """A picture counts for no more than this many times its expectation."""
    range: float = 10.0
    """Largest factor on Q's standard deviations; its inverse is the least."""
    tolerated: tuple[float, float] = (0.55, 1.5)
    """Estimates between these change nothing; a robot on wheels is moved in half of its numbers alone, which gives 0.7.
    """
    named: float = 3.0
    """Estimates beyond this, and below its inverse, are reported."""
    fewest: int = 8
    """Fewest pictures before anything is reported."""
    residual: float = 1.5
    """Mean of the residuals' ratio from which they are reported."""
    exposure: float = 2.0
    """The same of gain and bias, in standard deviations."""
    partial: float = 3.0
    """Mean square over squared median of residuals from which parts of the pictures differ, not all of them."""


@dataclass(frozen=True)
class Consistency:
    """State of the monitor after an update."""

    observed: float = 6.0
    """b, in units of the given Q."""
    expected: float = 6.0
    """a."""
    pictures: int = 0
    """Pictures so far."""
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
        """Probable cause of an inconsistency; None while there is none."""
        config = self.config
        if self.pictures < config.fewest:
            return None
        if self.exposure > config.exposure:
            return Cause.EXPOSURE
        if self.residual > config.residual:
            return Cause.CAMERA_OR_FIELD
        if self.mean_square > config.partial * max(1.0, self.residual**2):
            return Cause.MOVED_SCENE
        return None if 1 / config.named <= self.estimate <= config.named else Cause.NOISE_MODEL

    @property
    def sentence(self) -> str | None:
        """Cause for the user."""
        return None if self.cause is None else self.cause.value.format(factor=self.estimate, residual=self.residual)

    @property
    def numbers(self) -> dict[str, Any]:
        """Numbers of `consistency` in `fly --json`."""
        cause = None if self.cause is None else self.cause.name.lower()
        return {
            "cause": cause, "sentence": self.sentence, "noise_factor": self.estimate, "residual": self.residual,
            "pictures": self.pictures,
        }  # fmt: skip

    def after(self, result: FilterResult) -> "Consistency":
        """Return the state after an update, whose prediction held `noise_factor`."""
        seen, config = result.innovation, self.config
        if seen is None:
            return self
        keep, explained = math.exp(-1 / config.memory), seen.residual <= config.residual
        square = self.noise_factor**2 * min(seen.square, config.most * seen.determined)
        return replace(
            self,
            observed=keep * self.observed + square if explained else self.observed,
            expected=keep * self.expected + seen.determined if explained else self.expected,
            pictures=self.pictures + 1,
            residual=keep * self.residual + (1 - keep) * seen.residual,
            mean_square=keep * self.mean_square + (1 - keep) * seen.mean_square,
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
) -> Generator[FilterStep, None, FilterResult]:
    """Update as `estimator.update` does, with the process noise that was found so far, where the estimator takes it."""
    if not isinstance(estimator, Predictor):
        return (yield from estimator.update(belief, image, action, dt, generator))
    prediction, noise = estimator.predict(belief, action, dt, consistency.noise_factor)
    return (yield from estimator.correct(prediction, image, generator, noise))

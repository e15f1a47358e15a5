"""Filter update: the steps that it yields, the result that it returns, and the protocols of estimators.

All filters test by its contrast whether a picture is usable. Where it is not, the prediction is the posterior.
"""

from collections.abc import Generator
from dataclasses import dataclass
from enum import Enum
from typing import Protocol, TypeGuard, runtime_checkable

import torch
from jaxtyping import Bool, Float, Int, UInt8
from torch import Tensor

from nerfnav.estimator.core.belief import Belief, Curvature
from nerfnav.estimator.photometric.pixel_selection import Hidden, PixelSource
from nerfnav.robots import ProcessNoise, RigidState


class FilterOutcome(Enum):
    """Outcome of an update; the value is advice for the user."""

    UPDATED = "the picture was used"
    WEAK = "the picture said little: the dynamics led, and the belief stayed wide"
    PREDICTED_ONLY = "the picture said nothing: the dynamics alone moved the belief"
    DIVERGED = "the picture disagrees with the belief: relocalise"


@dataclass(frozen=True)
class FilterStep:
    """One iteration of a filter update."""

    iteration: int
    """Counted from 0."""
    mean: RigidState
    """Estimate after this iteration."""
    photometric: float
    """First term of Eq. 6 at this estimate."""
    process: float
    """Second term of Eq. 6 at this estimate."""
    pixels: Int[Tensor, "m 2"]
    """Pixels (u, v) that the photometric term compares."""
    residual: Float[Tensor, " m"]
    """Colour difference at each pixel, in [0, 1]."""
    believed: Bool[Tensor, " m"] | None = None
    """Inliers among the pixels at this estimate; None where outliers are not rejected."""
    pixel_source: PixelSource | None = None
    """Origin of the pixels; None where the estimator does not choose them."""


@dataclass(frozen=True)
class Innovation:
    """Move of the pose by a picture, and how far the camera's colours are off."""

    square: float
    """d' (Sigma-_TT)^-1 d: square of the move in units of the prediction."""
    determined: float
    """n: numbers of the pose that the picture determines, 0 to 6; the expectation of `square` where Q is right."""
    residual: float
    """Median difference of colours at the end, over that which the field's own noise gives."""
    mean_square: float
    """Mean square difference (Huber), likewise."""
    exposure: float
    """Largest of the camera's gain and bias, in standard deviations of what is usual."""


@dataclass(frozen=True)
class FilterResult:
    """Posterior of a filter update."""

    posterior: Belief
    """Belief after the update."""
    outcome: FilterOutcome
    """Use of the picture."""
    step: FilterStep
    """Last step: the posterior's mean, and the compared pixels."""
    curvature: Curvature | None = None
    """Origin of the posterior covariance; None where the prediction's own is kept."""
    innovation: Innovation | None = None
    """Move of the pose by the picture; None where none was compared, and of filters that do not report it."""


FilterUpdate = Generator[FilterStep, None, FilterResult]
"""Update in progress: yields each iteration, returns the result."""


@runtime_checkable
class Estimator(Protocol):
    """Estimator of the robot's state."""

    def update(
        self,
        belief: Belief,
        image: UInt8[Tensor, "height width 3"] | None,
        action: Float[Tensor, " a"],
        dt: float,
        generator: torch.Generator,
    ) -> FilterUpdate:
        """Predict over an action of `dt` [s], and correct by the picture taken then, if any."""
        ...


@runtime_checkable
class Corrector(Protocol):
    """Estimator that corrects any prediction by a picture."""

    @property
    def trust_dynamics(self) -> bool:
        """Return True where the prediction counts in the posterior; False: it is the start only."""
        ...

    def correct(
        self,
        prediction: Belief,
        image: UInt8[Tensor, "height width 3"] | None,
        generator: torch.Generator,
        noise: ProcessNoise | None = None,
    ) -> FilterUpdate:
        """Correct a prediction by a picture; `noise` is the process noise in the prediction, if known."""
        ...


@runtime_checkable
class Predictor(Corrector, Protocol):
    """Estimator whose process noise can be scaled."""

    def predict(
        self, belief: Belief, action: Float[Tensor, " a"], dt: float, noise_factor: float = 1.0
    ) -> tuple[Belief, ProcessNoise]:
        """Predict over an action of `dt` [s] with a factor on Q's standard deviations; returns also this noise."""
        ...


@runtime_checkable
class Masked(Protocol):
    """Estimator that may leave pixels of a picture out."""

    @property
    def takes_hidden(self) -> bool:
        """Return True: `correct` takes pixels that are not compared."""
        ...

    def correct(
        self,
        prediction: Belief,
        image: UInt8[Tensor, "height width 3"] | None,
        generator: torch.Generator,
        noise: ProcessNoise | None = None,
        hidden: Hidden | None = None,
    ) -> FilterUpdate:
        """Correct as Corrector does, without pixels that are `hidden`."""
        ...


def measure_contrast(image: UInt8[Tensor, "height width 3"]) -> int:
    """Return the largest difference of two pixels in one channel [levels of 255]."""
    flat = image.reshape(-1, 3)
    return int((flat.amax(0).int() - flat.amin(0).int()).max())


def is_usable(image: UInt8[Tensor, "height width 3"] | None, least_contrast: int) -> TypeGuard[Tensor]:
    """Return True for a picture of at least this contrast [levels of 255]."""
    return image is not None and measure_contrast(image) >= least_contrast


def keep_prediction(prediction: Belief) -> FilterUpdate:
    """Update without a picture: the prediction is the posterior."""
    step = FilterStep(0, prediction.mean, 0.0, 0.0, torch.zeros(0, 2, dtype=torch.long), torch.zeros(0))
    yield step
    return FilterResult(prediction, FilterOutcome.PREDICTED_ONLY, step)

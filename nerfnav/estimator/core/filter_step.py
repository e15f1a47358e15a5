"""Filter step: the frozen record of each iteration of a filter; the last one carries the posterior and the outcome.

All filters test in the same way whether a picture is usable: by its contrast. Where it is not, the prediction is the
posterior.
"""


from dataclasses import dataclass
from enum import Enum

import torch
from jaxtyping import Bool, Float, Int, UInt8
from torch import Tensor

from nerfnav.estimator.core.belief import Belief
from nerfnav.estimator.core.covariance import Curvature
from nerfnav.estimator.photometric.pixel_selection import PixelSource
from nerfnav.robots import RigidState


class FilterOutcome(Enum):
    """How an update ended; the value is advice for the user."""

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
    """The estimate after this iteration."""
    photometric: float
    """First term of Eq. 6 at this estimate."""
    process: float
    """Second term of Eq. 6 at this estimate."""
    pixels: Int[Tensor, "m 2"]
    """Pixels (u, v) that the photometric term compares."""
    residual: Float[Tensor, " m"]
    """Colour difference at each pixel, in [0, 1]."""
    posterior: Belief | None = None
    """None while the update goes on; set on the last step."""
    outcome: FilterOutcome | None = None
    """None while the update goes on; set on the last step."""
    believed: Bool[Tensor, " m"] | None = None
    """Which pixels count at this estimate, the others being outliers; None where nothing rejects outliers."""
    pixel_source: PixelSource | None = None
    """How the pixels were chosen; None where the estimator does not choose."""
    curvature: Curvature | None = None
    """How the posterior covariance was made; set on the last step of an update that used the picture."""


def measure_contrast(image: UInt8[Tensor, "height width 3"]) -> int:
    """The largest difference of two pixels in one channel [levels of 255]."""
    flat = image.reshape(-1, 3)
    return int((flat.amax(0).int() - flat.amin(0).int()).max())


def predicted_only(prediction: Belief) -> FilterStep:
    """The last step of an update without a picture: the prediction is the posterior."""
    none = torch.zeros(0)
    return FilterStep(
        0, prediction.mean, 0.0, 0.0, torch.zeros(0, 2, dtype=torch.long), none,
        posterior=prediction, outcome=FilterOutcome.PREDICTED_ONLY,
    )  # fmt: skip

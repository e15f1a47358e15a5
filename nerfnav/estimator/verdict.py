"""Whether a picture can be used: asked by all filters, in the same way."""

import torch
from jaxtyping import UInt8
from torch import Tensor

from nerfnav.estimator.belief import Belief
from nerfnav.estimator.steps import FilterOutcome, FilterStep


def contrast(image: UInt8[Tensor, "height width 3"]) -> int:
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

"""Whether a picture can be used: asked by all filters, in the same way."""

import torch
from jaxtyping import UInt8
from torch import Tensor

from nerfnav.errors import InvalidInputError
from nerfnav.estimator.belief import Belief
from nerfnav.estimator.steps import FilterOutcome, FilterStep
from nerfnav.geometry import Camera


def check_image(image: Tensor, camera: Camera) -> None:
    """Raise InvalidInputError unless `image` is a uint8 RGB picture of the camera's size."""
    wanted = (camera.height, camera.width, 3)
    if image.dtype != torch.uint8 or tuple(image.shape) != wanted:
        raise InvalidInputError(
            f"this camera takes uint8 pictures of {wanted[0]} x {wanted[1]} x 3 (height x width x RGB), not "
            f"{str(image.dtype).removeprefix('torch.')} of {' x '.join(map(str, image.shape))}"
        )


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

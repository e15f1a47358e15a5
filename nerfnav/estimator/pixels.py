"""Which pixels of a picture the filter compares: those around image features.

The paper draws pixels from a mask of dilated ORB features: flat areas say little about the pose, and features
alone (corners) are few. (Rublee et al., "ORB: an efficient alternative to SIFT or SURF", 2011.)
"""

from dataclasses import dataclass
from enum import Enum

import cv2
import numpy as np
import torch
from jaxtyping import Bool, Int, UInt8
from torch import Tensor


class PixelSource(Enum):
    """Where the compared pixels come from; the value is what a user reads."""

    FEATURES = "all pixels lie around image features"
    FILLED = "there were too few pixels around features: others were drawn from the whole picture"
    UNIFORM = "the picture has no features: all pixels were drawn from the whole picture"


@dataclass(frozen=True)
class PixelConfig:
    """How pixels are chosen."""

    count: int = 256
    """Pixels compared in an update (paper: 256; the authors' later code: 1,024)."""
    features: int = 500
    """ORB features looked for at most."""
    fast_threshold: int = 12
    """Least contrast of a corner to its surroundings [grey levels]."""
    edge_px: int = 4
    """Border of the picture without features [pixels]."""
    dilation_px: int = 7
    """Side of the square around a feature from which pixels are drawn [pixels]."""


@dataclass(frozen=True)
class PixelChoice:
    """The chosen pixels."""

    pixels: Int[Tensor, "m 2"]
    """(u, v), all different."""
    source: PixelSource
    """Where they come from."""


def feature_mask(image: UInt8[Tensor, "height width 3"], config: PixelConfig) -> Bool[Tensor, "height width"]:
    """Which pixels lie around ORB features."""
    grey = cv2.cvtColor(np.ascontiguousarray(image.cpu().numpy()), cv2.COLOR_RGB2GRAY)
    detector = cv2.ORB_create(  # pyright: ignore[reportAttributeAccessIssue]
        nfeatures=config.features, edgeThreshold=config.edge_px, fastThreshold=config.fast_threshold
    )
    mask = np.zeros(grey.shape, np.uint8)
    for keypoint in detector.detect(grey, None):
        u, v = keypoint.pt
        mask[min(round(v), grey.shape[0] - 1), min(round(u), grey.shape[1] - 1)] = 1
    mask = cv2.dilate(mask, np.ones((config.dilation_px, config.dilation_px), np.uint8))
    return torch.from_numpy(mask).bool()


def choose_pixels(
    image: UInt8[Tensor, "height width 3"], config: PixelConfig, generator: torch.Generator
) -> PixelChoice:
    """Draw `config.count` different pixels around the features of a picture, or all of a smaller one.

    Where the features offer too few, the rest is drawn from the remaining pixels, which `source` tells.
    """
    mask = feature_mask(image, config).reshape(-1)
    near, far = mask.nonzero().squeeze(-1), (~mask).nonzero().squeeze(-1)
    chosen = _draw(near, config.count, generator)
    source = PixelSource.FEATURES
    if len(chosen) < min(config.count, mask.numel()):
        source = PixelSource.UNIFORM if len(near) == 0 else PixelSource.FILLED
        chosen = torch.cat([chosen, _draw(far, config.count - len(chosen), generator)])
    width = image.shape[1]
    return PixelChoice(torch.stack([chosen % width, chosen // width], -1), source)


def _draw(index: Int[Tensor, " n"], count: int, generator: torch.Generator) -> Int[Tensor, " m"]:
    return index[torch.randperm(len(index), generator=generator)[:count]]

"""Pixel selection: choose which pixels of a picture the filter compares.

The paper draws pixels from a mask of dilated ORB features: flat areas say little about the pose, and features
alone (corners) are few. (Rublee et al., "ORB: an efficient alternative to SIFT or SURF", 2011.)

Or they are drawn by what they tell. With J_i = dC_i/dpose of a candidate and A the sum of J_j' J_j over all of them,

    h_i = tr(J_i A^-1 J_i')

is its leverage, the gain of log det A by counting it once more: drawing by it keeps log det nearly as large as the
best choice does (D-optimal design; Mahoney, "Randomized algorithms for matrices and data", 2011).

Each draw has its own faults. In a picture that shows little the features lie together, around what is near, and an
error of the field there drags the pose away with nothing to speak against it. What tells most by the field is in part
what is wrong in it, such as stains on a plain wall. So the fast filter takes half of its pixels from either.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import cv2
import numpy as np
import torch
from jaxtyping import Bool, Float, Int, UInt8
from torch import Tensor

Slopes = Callable[[Int[Tensor, "m 2"]], Float[Tensor, "m 3 6"]]
"""Derivative of pixels' colours by the pose, at where the camera is thought to be."""
Hidden = Bool[Tensor, "height width"]
"""Pixels that show something else than the field."""
_LEAST_TOLD = 1e-6
"""Added to A, as a share of its mean diagonal, for directions of which no pixel tells anything."""

_AROUND, _LEAST_STEEP = 9, 1e-3
"""Side of the square whose steepest pixel counts [pixels]; what pixels of a plain area count [share of the mean]."""


class PixelDraw(Enum):
    """Selection of pixels; the value is the user's text."""

    FEATURES = "around image features"
    INFORMATION = "by how much they tell about the pose"
    BOTH = "half of them around image features, the others by how much they tell about the pose"
    UNIFORM = "evenly from the whole picture"


class PixelSource(Enum):
    """Origin of the compared pixels; the value is the user's text."""

    FEATURES = "all pixels lie around image features"
    FILLED = "there were too few pixels around features: others were drawn from the whole picture"
    UNIFORM = "all pixels were drawn from the whole picture, as asked or for want of features"
    ALL = "all pixels of the picture"
    INFORMATION = "pixels that tell most about the pose"
    BOTH = "pixels around image features, and others that tell most about the pose"


@dataclass(frozen=True)
class PixelConfig:
    """Options of the selection of pixels."""

    count: int = 256
    """Pixels compared in an update of the paper's filter (paper: 256; the authors' later code: 1,024); the fast
    filter's number and draw are its pyramid's."""
    draw: PixelDraw = PixelDraw.FEATURES
    """Selection (paper: around features)."""
    candidates: int = 2
    """Where information counts: times as many pixels of the whole picture are asked what they tell."""
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
    """Chosen pixels, with their origin."""

    pixels: Int[Tensor, "m 2"]
    """(u, v), all different."""
    source: PixelSource
    """Origin of the pixels."""


def feature_mask(image: UInt8[Tensor, "height width 3"], config: PixelConfig) -> Bool[Tensor, "height width"]:
    """Return the mask of pixels around ORB features."""
    grey = cv2.cvtColor(np.ascontiguousarray(image.cpu().numpy()), cv2.COLOR_RGB2GRAY)
    detector = cv2.ORB_create(  # pyright: ignore[reportAttributeAccessIssue]
        nfeatures=config.features, edgeThreshold=config.edge_px, fastThreshold=config.fast_threshold
    )
    mask = np.zeros(grey.shape, np.uint8)
    places = np.rint(cv2.KeyPoint.convert(detector.detect(grey, None))).astype(np.int64).reshape(-1, 2)
    mask[places[:, 1].clip(max=grey.shape[0] - 1), places[:, 0].clip(max=grey.shape[1] - 1)] = 1
    mask = cv2.dilate(mask, np.ones((config.dilation_px, config.dilation_px), np.uint8))
    return torch.from_numpy(mask).bool()


def choose_pixels(
    image: UInt8[Tensor, "height width 3"],
    config: PixelConfig,
    generator: torch.Generator,
    slopes: Slopes,
    hidden: Hidden | None = None,
) -> PixelChoice:
    """Draw `config.count` different pixels of a picture as `config.draw` says, or all of a smaller one; none that is
    `hidden`.

    Where features offer too few, the rest is drawn from the remaining pixels, which `source` tells. `slopes` is asked
    only where information counts.
    """
    left = torch.ones(image.shape[:2], dtype=torch.bool) if hidden is None else ~hidden
    left = left.reshape(-1)
    every = left.nonzero().squeeze(-1)
    if config.count >= len(every):
        return PixelChoice(_places(every, image), PixelSource.ALL)
    near = _around_features(image, config, generator, left)
    if len(near) == config.count:
        return PixelChoice(_places(near, image), PixelSource.FEATURES)
    left[near] = False
    others, wanted = left.nonzero().squeeze(-1), config.count - len(near)
    if config.draw in (PixelDraw.INFORMATION, PixelDraw.BOTH):
        asked = _draw(others, config.candidates * wanted, generator)
        others = asked[draw_by_information(slopes(_places(asked, image)), wanted, generator)]
    else:
        others = _draw(others, wanted, generator)
    return PixelChoice(_places(torch.cat([near, others]), image), _source(config, len(near)))


def _around_features(
    image: UInt8[Tensor, "height width 3"],
    config: PixelConfig,
    generator: torch.Generator,
    left: Bool[Tensor, " pixels"],
) -> Int[Tensor, " n"]:
    """As many as `config.draw` wants of those that are left, or as there are."""
    wanted = {PixelDraw.FEATURES: config.count, PixelDraw.BOTH: config.count // 2}.get(config.draw, 0)
    if wanted == 0:
        return torch.arange(0)
    return _draw((feature_mask(image, config).reshape(-1) & left).nonzero().squeeze(-1), wanted, generator)


def _source(config: PixelConfig, near: int) -> PixelSource:
    """Return the origin of pixels of which so many lie around features, and others do not."""
    if config.draw in (PixelDraw.INFORMATION, PixelDraw.BOTH):
        return PixelSource.BOTH if near else PixelSource.INFORMATION
    return PixelSource.FILLED if near else PixelSource.UNIFORM


def draw_by_information(slopes: Float[Tensor, "m 3 6"], count: int, generator: torch.Generator) -> Int[Tensor, " n"]:
    """Draw `count` of m pixels by leverage, without replacement (Efraimidis and Spirakis 2006).

    Derivatives that are not finite count as 0.
    """
    flat = slopes.double().nan_to_num(0, 0, 0).flatten(0, 1)
    information = flat.T @ flat
    information = information + _LEAST_TOLD * (information.diagonal().mean() + 1e-30) * torch.eye(6).double()
    whitened = torch.linalg.solve_triangular(torch.linalg.cholesky(information), flat.T, upper=False)
    leverage = whitened.square().sum(0).reshape(-1, 3).sum(-1)
    late = torch.empty_like(leverage).exponential_(generator=generator) / leverage.clamp_min(1e-30)
    return late.argsort()[:count]


def draw_by_gradient(
    image: UInt8[Tensor, "height width 3"], count: int, generator: torch.Generator
) -> Int[Tensor, "m 2"]:
    """Draw different pixels by the largest difference of neighbours around them, of the mean over the channels."""
    grey = image.float().mean(-1)
    steep = torch.zeros_like(grey)
    steep[:, 1:] += grey.diff(dim=1).abs()
    steep[1:] += grey.diff(dim=0).abs()
    steep = torch.from_numpy(cv2.dilate(steep.numpy(), np.ones((_AROUND, _AROUND), np.uint8))).flatten()
    likely = steep + _LEAST_STEEP * steep.mean() + 1e-6
    late = torch.empty_like(likely).exponential_(generator=generator) / likely
    return _places(late.topk(min(count, len(late)), largest=False).indices, image)


def _places(index: Int[Tensor, " m"], image: UInt8[Tensor, "height width 3"]) -> Int[Tensor, "m 2"]:
    width = image.shape[1]
    return torch.stack([index % width, index // width], -1)


def _draw(index: Int[Tensor, " n"], count: int, generator: torch.Generator) -> Int[Tensor, " m"]:
    return index[torch.randperm(len(index), generator=generator)[:count]]

"""Exposure compensation: estimate each photograph's gain in brightness and white balance, repeatedly in training.

A field has one brightness. Where photographs disagree, it grows fog in front of cameras to fit each of them; given
how bright each one is, it need not. With colours I of photograph i and those of the field C along the same rays, the
gain of channel c is the one that makes sum (I - g C)^2 least:  g_ic = <I, C> / <C, C>,  l_ic = log g_ic.

What a field does not show yet looks like exposure, too. So each photograph is compared in four quarters: light is the
same in all of them, mistakes are not. By the analysis of variance with one random factor, a share 1 - v / b of the
gains' variance b between photographs is real, v being the mean variance between the quarters of one, over 4; each
gain is shrunk to 1 by that share (James and Stein, 1961), the common part a_i of its three channels and what is left
of each, its white balance, by shares of their own. Pictures that were rendered so keep gains of 1.
"""

from dataclasses import replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from nerfnav.core.jit import default_threads, threads
from nerfnav.field.train.grid_learner import GridLearner
from nerfnav.field.train.rays import RaySampler
from nerfnav.field.train.torch_learner import TorchLearner
from nerfnav.geometry import PosedImages

QUARTERS = 4
"""Parts of a photograph that are compared one by one."""
_LEAST, _MOST = 0.5, 2.0
"""Gains beyond this are no exposure: the field does not show that place yet."""
_FEWEST = 3
"""Number of photographs below which exposure cannot be separated from errors."""

Gains = Float[Tensor, "n 3"]


def estimate_gains(taken: Float[Tensor, "n q p 3"], shown: Float[Tensor, "n q p 3"]) -> Gains:
    """The gains of photographs against a field, of which `p` pixels in each of `q` parts are compared.

    The geometric mean of each channel is 1.
    """
    count = len(taken)
    if count < _FEWEST:
        return torch.ones(count, 3)
    products, squares = (taken * shown).sum(2), shown.square().sum(2)
    whole = _logarithm(products.sum(1), squares.sum(1))
    parts = _logarithm(products, squares)
    whole, parts = whole - whole.mean(0), parts - whole.mean(0)
    common, common_parts = whole.mean(-1, keepdim=True), parts.mean(-1, keepdim=True)
    balance, balance_parts = whole - common, parts - common_parts
    shrunk = _shrunk(common, common_parts) + _shrunk(balance, balance_parts)
    return (shrunk - shrunk.mean(0)).exp()


def estimate_common_gains(taken: Float[Tensor, "n h w 3"], shown: Float[Tensor, "n h w 3"]) -> Float[Tensor, " n"]:
    """The gain of each whole picture against what a field shows, the same for all channels."""
    return estimate_gains(_quarters(taken), _quarters(shown)).log().mean(-1).exp()


_NEARLY_BLACK = 1e-3


def leave_out(
    colors: Float[Tensor, "*pixels 3"], counted: Bool[Tensor, "*pixels"] | None
) -> Float[Tensor, "*pixels 3"]:
    """Make pixels that do not count nearly black: they weigh next to nothing, and are equal in all pictures."""
    return colors if counted is None else torch.where(counted[..., None], colors, _NEARLY_BLACK)


def correct_exposure(photographs: PosedImages, gains: Gains) -> PosedImages:
    """The photographs as they would be with gains of 1, as far as bytes can hold that."""
    images = [(image / gain).clamp(0, 255).round() for image, gain in zip(photographs.images, gains, strict=True)]
    return replace(photographs, images=torch.stack(images).to(torch.uint8)) if images else photographs


def _quarters(pictures: Float[Tensor, "n h w 3"]) -> Float[Tensor, "n 4 p 3"]:
    """The four quarters of pictures; a row or column in the middle is left out where there is one."""
    height, width = pictures.shape[1] // 2, pictures.shape[2] // 2
    rows, columns = (slice(0, height), slice(-height, None)), (slice(0, width), slice(-width, None))
    return torch.stack([pictures[:, row, column].flatten(1, 2) for row in rows for column in columns], 1)


def _logarithm(products: Float[Tensor, "*parts 3"], squares: Float[Tensor, "*parts 3"]) -> Float[Tensor, "*parts 3"]:
    return (products / squares.clamp_min(1e-9)).clamp(_LEAST, _MOST).log()


def _shrunk(whole: Float[Tensor, "n c"], parts: Float[Tensor, "n q c"]) -> Float[Tensor, "n c"]:
    """Logarithms of gains, shrunk to 0 by the share of their variance that quarters of photographs explain."""
    chance = parts.var(1).mean() / parts.shape[1]
    return whole * (1 - chance / whole.var(0).mean().clamp_min(1e-12)).clamp_min(0.0)


_EVERY = 0.08
"""Share of the training between two estimates of the gains."""
_RAYS = 128
"""Rays of each quarter of each photograph that are compared."""


class ExposureCorrection:
    """Correction of a sampler of training rays by the gains of its photographs, estimated again and again."""

    def __init__(self, sampler: RaySampler, wanted: bool) -> None:
        """Unless `wanted`, all gains stay 1."""
        self._sampler, self._next = sampler, _EVERY if wanted else torch.inf

    def look(self, learner: GridLearner | TorchLearner, fraction: float) -> None:
        """Correct the sampler by what the learner shows, if it is time to: `fraction` of the training is done."""
        if fraction < self._next:
            return
        self._next = fraction + _EVERY
        with threads(default_threads()):
            batch = self._sampler.draw_quarters(_RAYS)
            counted = None if batch.counted is None else torch.from_numpy(batch.counted)
            colors = [leave_out(part, counted) for part in (torch.from_numpy(batch.targets), learner.colors(batch))]
        taken, shown = (part.reshape(-1, QUARTERS, _RAYS, 3) for part in colors)
        self._sampler.correct(estimate_gains(taken, shown))

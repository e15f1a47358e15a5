"""How far a field's colours are from photographs that it never saw: PSNR, and the measurement noise of a filter.

The residual of a colour is far from Gaussian: most of a picture is matched closely, and edges that lie half a voxel
off are far out. So there are three numbers. `noise_std` is the root mean square over all pixels and channels, tails and
all: this is what the filters take for their measurement noise, since it promises no more than the field keeps.
`noise_core_std` is 1.4826 times the median absolute residual of the pixels that show more than the background, which
outliers do not move: what the noise would be if they were all found. `outlier_share` is the share of those pixels that
err by more than three times as much in some channel: what a filter that rejects outliers must expect.
"""

from dataclasses import replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from nerfnav.field.field import Field
from nerfnav.field.info import FieldInfo
from nerfnav.field.render import render_image
from nerfnav.geometry import PosedImages, psnr_db

_DEVIATION_PER_MEDIAN = 1.4826
"""Standard deviation of a Gaussian whose median absolute value is 1."""
_OUTLIER_DEVIATIONS = 3.0
_SOMETHING = 0.5
"""Opacity above which a pixel shows the field and not the background, which has no residual."""


def residual(field: Field, photographs: PosedImages) -> Float[Tensor, "n height width 3"]:
    """Colour of the field minus colour of the photographs, in [-1, 1], for each pixel."""
    return torch.stack(
        [
            render_image(field, photographs.camera, photographs.poses[index]).color - image.float() / 255
            for index, image in enumerate(photographs.images)
        ]
    )


def calibrated(info: FieldInfo, field: Field, held_out: PosedImages) -> FieldInfo:
    """`info` with what held-out photographs say about the field; unchanged where there are none."""
    if len(held_out) == 0:
        return info
    error, shown = residual(field, held_out), _shown(field, held_out)
    # PSNR as the literature has it: the mean over the images
    psnrs = [psnr_db(image.square().mean().item()) for image in error]
    told = error[shown] if shown.any() else error.reshape(-1, 3)
    core = _DEVIATION_PER_MEDIAN * told.abs().median()
    return replace(
        info,
        psnr_db=sum(psnrs) / len(psnrs),
        noise_std=float(error.square().mean().sqrt()),
        noise_core_std=float(core),
        outlier_share=float((told.abs() > _OUTLIER_DEVIATIONS * core).any(-1).float().mean()),
    )


def _shown(field: Field, photographs: PosedImages) -> Bool[Tensor, "n height width"]:
    """Which pixels the field shows something in."""
    return torch.stack(
        [
            render_image(field, photographs.camera, photographs.poses[index]).opacity > _SOMETHING
            for index in range(len(photographs))
        ]
    )

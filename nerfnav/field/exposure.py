"""How much brighter or darker each photograph is than the others: phones choose the exposure of each by themselves.

A field has one brightness. Where photographs disagree, it grows fog in front of cameras to please each of them; told
how bright each one is, it need not. With a photograph I and the field's picture C from the same place, the gain is the
one that makes sum |I - g C|^2 least:  g = <I, C> / <C, C>.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.field.field import Field
from nerfnav.field.render import render_image
from nerfnav.geometry import PosedImages, reduced

_REDUCED = 0.25
"""Photographs are compared at a quarter of their size: exposure needs no detail."""
_LEAST, _MOST = 0.5, 2.0
"""Gains beyond this are no exposure: the field does not show that place yet."""


def gains(field: Field, photographs: PosedImages) -> Float[Tensor, " n"]:
    """The gain of each photograph against the field, their geometric mean 1."""
    camera = photographs.camera.scaled(_REDUCED)
    found = []
    for index, image in enumerate(photographs.images):
        small = reduced(image, camera)
        shown = render_image(field, camera, photographs.poses[index]).color.cpu().reshape(-1, 3)
        found.append((small * shown).sum() / shown.square().sum().clamp_min(1e-9))
    told = torch.stack(found).clamp(_LEAST, _MOST)
    return told / told.log().mean().exp()

"""How much of a place is proven free or solid, in words for whoever opens it."""

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.field.evidence import State
from nerfnav.field.field import Field
from nerfnav.field.voxel import VoxelField

_WORTH_SAYING = 0.2
"""Share of the box: what is inside stones and under the ground is unproven everywhere."""
_LAYERS = ("the floor", "what stands at half its height", "what is high up")
"""What photographs of the lowest, the middle and the highest third of a box show."""


def unproven_in_words(field: Field) -> str:
    """A sentence that says what is not proven, and what would help; empty where nearly everything is."""
    if not isinstance(field, VoxelField) or field.evidence is None:
        return "Nothing proves what is free here: plans trust the field alone."
    unproven = (field.evidence == State.UNPROVEN).float()
    share = float(unproven.mean())
    if share < _WORTH_SAYING:
        return ""
    where = _LAYERS[int(_by_height(unproven).argmax())]
    means = "more photographs" if field.info.proven_from == "depth" else "more photographs, or depth maps,"
    return f"{share:.0%} of this place is unproven and counts as solid: {means} of {where} would help most."


def _by_height(unproven: Float[Tensor, "nx ny nz"]) -> Float[Tensor, " layers"]:
    """How much there is in each layer, from below."""
    return torch.stack([part.sum() for part in unproven.tensor_split(len(_LAYERS), dim=2)])

"""How much of a place is proven free or solid, in words for whoever opens it."""

from nerfnav.field.core.protocol import Field
from nerfnav.field.models.grid_field import GridField

_WORTH_SAYING = 0.2
"""Share of the box: what is inside stones and under the ground is unproven everywhere."""
_LAYERS = ("the floor", "what stands at half its height", "what is high up")
"""What photographs of the lowest, the middle and the highest third of a box show."""


def unproven_in_words(field: Field) -> str:
    """A sentence that says what is not proven, and what would help; empty where nearly everything is."""
    unproven = field.unproven_by_height if isinstance(field, GridField) else None
    if not isinstance(field, GridField) or unproven is None:
        return "Nothing proves what is free here: plans trust the field alone."
    share = float(unproven.mean())
    if share < _WORTH_SAYING:
        return ""
    layers = [float(part.sum()) for part in unproven.tensor_split(len(_LAYERS))]
    where = _LAYERS[layers.index(max(layers))]
    means = "more photographs" if field.info.proven_from == "depth" else "more photographs, or depth maps,"
    return f"{share:.0%} of this place is unproven and counts as solid: {means} of {where} would help most."

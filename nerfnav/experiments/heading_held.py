"""Cost term of a heading that is held."""


from jaxtyping import Float
from torch import Tensor

from nerfnav.geometry import so3
from nerfnav.planner import (
    CostTerm,
    TermContext,
)
from nerfnav.robots import Motion

_HELD = 1e4
"""Weight of a heading that is held, in units of J for a squared radian: it strays by less than a degree."""


def heading_held(_: TermContext, motion: Motion) -> Float[Tensor, "*batch"]:
    """What it costs to turn away from the first attitude: squared angles [rad^2], summed over time."""
    rotation = motion.states.rotation
    turned = so3.local(rotation[..., :1, :, :].expand_as(rotation), rotation)
    return turned.square().sum((-2, -1))


HEADING_HELD = CostTerm("heading held", heading_held, _HELD)

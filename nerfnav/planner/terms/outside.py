"""The penalty that keeps a motion in the field's box, outside which every density is 0."""

from jaxtyping import Float
from torch import Tensor

from nerfnav.planner import costs
from nerfnav.planner.kernels import collision as kernels
from nerfnav.planner.terms.term import Adjoint, CostTerm, Kernel, TermContext
from nerfnav.robots import FlatMap, Motion


def outside(context: TermContext, motion: Motion) -> Float[Tensor, "*batch"]:
    """Squared distance of the positions from the box [m^2], summed over time."""
    return costs.outside(context.field.box, motion)


def outside_kernel(context: TermContext, weight: float) -> Kernel:
    """The compiled twin."""
    box = context.field.box
    lower, upper = (edge.double().cpu().numpy() for edge in (box.lower, box.upper))

    def weighed(flat: FlatMap, by: Adjoint) -> float:
        return kernels.outside(flat.position, lower, upper, weight, by.position)

    return weighed


OUTSIDE = CostTerm("outside", outside, None, outside_kernel, preconditions=True)

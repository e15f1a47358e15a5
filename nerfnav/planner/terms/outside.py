"""Border term: the penalty that keeps the whole body in the field's box, see space/border.py; density beyond it is
0."""

from jaxtyping import Float
from torch import Tensor

from nerfnav.planner.kernels import terms as kernels
from nerfnav.planner.space import border
from nerfnav.planner.terms.term import CostTerm, Kernel, TermContext
from nerfnav.robots import Motion


def outside(context: TermContext, motion: Motion) -> Float[Tensor, "*batch"]:
    """Sum the squared distance by which the body reaches beyond the box over time [m^2]."""
    return border.outside(context.field.box, motion, context.body)


def outside_kernel(context: TermContext, weight: float) -> Kernel:
    """Make the compiled twin of the term."""
    box = context.field.box
    lower, upper = (edge.double().cpu().numpy() for edge in (box.lower, box.upper))
    space = (lower, upper, border.reach_of(context.body))
    return lambda flat, by: kernels.outside(flat.position, flat.rotation, space, weight, by.position, by.rotation)


OUTSIDE = CostTerm("outside", outside, None, outside_kernel, preconditions=True)

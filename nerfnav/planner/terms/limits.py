"""Limits term: the penalty that keeps a motion well defined and within the robot's limits."""

from jaxtyping import Float
from torch import Tensor

from nerfnav.planner.terms.term import CostTerm, Kernel, TermContext
from nerfnav.robots import Motion


def limits(context: TermContext, motion: Motion) -> Float[Tensor, "*batch"]:
    """Return the robot's own `limits` [1]."""
    return context.robot.limits(motion)


def limits_kernel(_: TermContext, weight: float) -> Kernel:
    """Make the twin of the term: the flatness map's own, which keeps the derivative for its `backward`."""
    return lambda flat, _: flat.limits(weight)


LIMITS = CostTerm("limits", limits, None, limits_kernel, preconditions=True)

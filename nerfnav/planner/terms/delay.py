"""Delay term: the cost of arriving later, for plans whose arrival is put off at each step; not in Eq. 2.

    sum_t sqrt(|p_t - p_N|^2 + s^2) - s        s: NEAR

A plan of N steps leaves most of its path to the last of them, where that takes the least effort. A robot that makes a
new one of as many steps each time (a receding horizon that has reached its shortest) therefore comes nearer ever more
slowly, while noise pushes it away. With a running cost, the best first action no longer depends on how often the
arrival was put off (Mayne et al., "Constrained model predictive control: stability and optimality", 2000).
"""

from jaxtyping import Float
from torch import Tensor

from nerfnav.planner.kernels import terms as kernels
from nerfnav.planner.kernels.terms import NEAR
from nerfnav.planner.terms.term import Adjoint, CostTerm, Kernel, TermContext
from nerfnav.robots import FlatMap, Motion

_PRICE = 3.0
"""Price of a metre that is left, for each step [J/m]."""


def delay(context: TermContext, motion: Motion) -> Float[Tensor, "*batch"]:
    """Sum the distance from the end of the motion over time [m]."""
    position = motion.states.position
    off = position - position[..., -1:, :]
    return ((off.square().sum(-1) + NEAR**2).sqrt() - NEAR).sum(-1)


def delay_kernel(context: TermContext, weight: float) -> Kernel:
    """Make the compiled twin of the term."""

    def weighed(flat: FlatMap, by: Adjoint) -> float:
        return kernels.delay(flat.position, weight, by.position)

    return weighed


DELAY = CostTerm("delay", delay, _PRICE, delay_kernel, preconditions=True)

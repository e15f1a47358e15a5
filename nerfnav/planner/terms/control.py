"""Control term of Eq. 2: sum_t u_t' Gamma u_t."""

import numpy as np
from jaxtyping import Float
from torch import Tensor

from nerfnav.planner.kernels import terms as kernels
from nerfnav.planner.risk import costs
from nerfnav.planner.terms.term import CostTerm, Kernel, TermContext
from nerfnav.robots import Motion


def control(context: TermContext, motion: Motion) -> Float[Tensor, "*batch"]:
    """Sum the effort [1], with the robot's `action_weights` as the diagonal of Gamma."""
    return costs.control(motion, motion.actions.new_tensor(context.robot.action_weights))


def control_kernel(context: TermContext, weight: float) -> Kernel:
    """Make the compiled twin of the term."""
    gamma = weight * np.array(context.robot.action_weights)
    return lambda flat, by: kernels.control(flat.action, gamma, by.action)


CONTROL = CostTerm("control", control, None, control_kernel, preconditions=True)

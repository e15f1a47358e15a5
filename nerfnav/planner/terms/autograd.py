"""The derivative of a term that brings no kernel, by autograd: slower by a part of a millisecond or more.

A term is differentiated by the parts of the motion: positions, attitudes and actions go on through the compiled
flatness map like those of every other term. The map's adjoint takes no velocities and body rates; a term that looks
at these is differentiated through the robot's own `motion` for them.
"""

from typing import final

import numpy as np
import torch
from torch import Tensor

from nerfnav.planner.route import Route
from nerfnav.planner.terms.term import Adjoint, CostTerm, TermContext
from nerfnav.planner.trajectory import motion_of
from nerfnav.robots import FlatMap, Motion, RigidState


@final
class AutogradKernel:
    """A term in the shape of a compiled one, in double precision."""

    def __init__(self, term: CostTerm, context: TermContext, route: Route) -> None:
        """Differentiate a term for motions along a route."""
        self._term, self._context, self._route = term, context, route.to(torch.float64)

    def __call__(self, flat: FlatMap, by: Adjoint) -> float:
        """See Kernel."""
        arrays = (flat.position, flat.velocity, flat.rotation, flat.rate, flat.action)
        parts = [torch.from_numpy(array.copy()).requires_grad_() for array in arrays]
        value = self._term.cost(self._context, Motion(RigidState(*parts[:4]), parts[4], flat.dt)).double()
        if not value.requires_grad:
            return value.item()
        position, velocity, rotation, rate, action = torch.autograd.grad(value, parts, allow_unused=True)
        if position is not None:
            by.position[:] += position.numpy()
        if rotation is not None:
            by.rotation[:] += _in_tangent(flat.rotation, rotation.numpy())
        if action is not None:
            by.action[:] += action.numpy()
        if velocity is not None or rate is not None:
            through = self._through_motion(by.free, velocity, rate)
            by.by_free = through if by.by_free is None else by.by_free + through
        return value.item()

    def _through_motion(self, at: np.ndarray, by_velocity: Tensor | None, by_rate: Tensor | None) -> np.ndarray:
        """Derivative by the free numbers (k), from those by velocities and body rates."""
        free = torch.from_numpy(at.copy()).requires_grad_()
        states = motion_of(self._context.robot, free, self._route).states
        pairs = [(states.velocity, by_velocity), (states.body_rate, by_rate)]
        asked = [(part, by) for part, by in pairs if by is not None and part.requires_grad]
        if not asked:
            return np.zeros_like(at)
        outputs, weights = zip(*asked, strict=True)
        (gradient,) = torch.autograd.grad(outputs, free, weights)
        return gradient.numpy()


def _in_tangent(rotation: np.ndarray, by_matrix: np.ndarray) -> np.ndarray:
    """Derivative in the tangents of attitudes (n, 3) from those by their matrices: <G, R [d]x> = g . d."""
    a = np.swapaxes(rotation, -1, -2) @ by_matrix
    return np.stack([a[:, 2, 1] - a[:, 1, 2], a[:, 0, 2] - a[:, 2, 0], a[:, 1, 0] - a[:, 0, 1]], -1)

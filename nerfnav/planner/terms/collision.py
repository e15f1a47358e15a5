"""Collision term of Eq. 2: sum_t sum_b rho(x_b) s(b)."""

from functools import partial
from typing import final

import numpy as np
from jaxtyping import Float
from torch import Tensor

from nerfnav.field import FastDensity, density_and_gradient
from nerfnav.planner.kernels import terms as kernels
from nerfnav.planner.risk import costs
from nerfnav.planner.terms.term import Adjoint, CostTerm, TermContext
from nerfnav.robots import FlatMap, Motion


def collision(context: TermContext, motion: Motion) -> Float[Tensor, "*batch"]:
    """Sum the density met by the body points on their paths [1]."""
    return costs.collision(context.field, motion, context.body, context.weights.samples_per_step)


@final
class CollisionKernel:
    """Compiled twin of the collision term."""

    def __init__(self, context: TermContext, weight: float) -> None:
        """Weight the density that the body of a context meets."""
        field, parts = context.field, context.weights.samples_per_step
        fast = isinstance(field, FastDensity)  # checked once: it takes as long as the densities of a coarse body
        self._density = field.density_and_gradient if fast else partial(density_and_gradient, field)
        self._points_body, self._weight = context.body.points_body.double().cpu().numpy(), weight
        self._fractions = (np.arange(parts) + 0.5) / parts
        self._world, self._samples = np.empty((0, 0, 3)), np.empty((0, 0, 0, 3))

    def __call__(self, flat: FlatMap, by: Adjoint) -> float:
        """Implement Kernel: the weighted term."""
        times, count, parts = len(flat.position), len(self._points_body), len(self._fractions)
        if len(self._world) != times:
            self._world, self._samples = np.empty((times, count, 3)), np.empty((times - 1, count, parts, 3))
        kernels.place_points(
            flat.position, flat.rotation, self._points_body, self._fractions, self._world, self._samples
        )
        density, slope = self._density(self._samples.reshape(-1, 3))
        return kernels.collision(
            flat.rotation, self._points_body, self._fractions, self._world, density.reshape(self._samples.shape[:3]),
            slope.reshape(self._samples.shape), self._weight, by.position, by.rotation,
        )  # fmt: skip


COLLISION = CostTerm("collision", collision, None, CollisionKernel)

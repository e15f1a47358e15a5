"""J of Eq. 2 in one compiled call, where robot, field and terms are all known to kernels; else term by term.

See planner/kernels/quadrotor.py. What is not known (a term of one's own, another robot, a composite field) is evaluated
by objective.py with the same result.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from nerfnav.planner.kernels import quadrotor as kernels
from nerfnav.planner.steps import PlanCost
from nerfnav.planner.terms.collision import COLLISION
from nerfnav.planner.terms.control import CONTROL
from nerfnav.planner.terms.limits import LIMITS
from nerfnav.planner.terms.outside import OUTSIDE
from nerfnav.planner.terms.risk import RISK, danger_of
from nerfnav.planner.terms.term import CostTerm, TermContext
from nerfnav.robots import FlatMap
from nerfnav.robots.quadrotor_map import QuadrotorMap

_KNOWN = (COLLISION, CONTROL, LIMITS, OUTSIDE, RISK)


@runtime_checkable
class DensityGrid(Protocol):
    """A field whose densities kernels find in a grid."""

    @property
    def density_grid(self) -> tuple[np.ndarray, ...]:
        """Values, leaps, lower corner [m], nodes per metre, scale of densities, and both corners of the box [m]."""
        ...


@dataclass(frozen=True)
class Evaluation:
    """J at one point of the search."""

    free: np.ndarray
    """The free numbers (k)."""
    cost: PlanCost
    """The terms of J."""
    gradient: np.ndarray
    """dJ / d free (k)."""


@dataclass(frozen=True)
class LineSearch:
    """Backtracking (Nocedal and Wright, "Numerical Optimization", 2006, Alg. 3.1)."""

    armijo: float = 1e-4
    """Share of the slope by which J must fall."""
    low: float = 0.1
    """Least factor between two tries of a step."""
    high: float = 0.5
    """Largest factor."""
    tries: int = 12
    """At most so many."""


@dataclass(frozen=True)
class FusedObjective:
    """J of a quadrotor in a grid."""

    parts: tuple
    """What the kernels ask for: task, body, space, weights."""

    @classmethod
    def of(cls, context: TermContext, terms: Sequence[CostTerm], flat: FlatMap) -> "FusedObjective | None":
        """J for a map between two ends; None where the kernels do not know all that it takes."""
        field, weights = context.field, context.weights
        counted = len(terms) == len(_KNOWN) and all(any(term is known for term in terms) for known in _KNOWN)
        if not (counted and isinstance(flat, QuadrotorMap) and isinstance(field, DensityGrid)):
            return None
        gamma = CONTROL.weighed(weights) * np.array(context.robot.action_weights)
        fractions = (np.arange(weights.samples_per_step) + 0.5) / weights.samples_per_step
        body = (context.body.points_body.double().cpu().numpy(), fractions)
        weighed = tuple(float(term.weighed(weights)) for term in (COLLISION, LIMITS, OUTSIDE, RISK))
        space = (*field.density_grid, *danger_of(context))
        return cls(((*flat.constants, gamma), body, space, weighed))

    def __call__(self, free: np.ndarray) -> Evaluation:
        """J and its gradient."""
        gradient = np.empty(len(free))
        return Evaluation(free, PlanCost(*kernels.evaluate(free, *self.parts, gradient)), gradient)

    def effort_curvature(self, free: np.ndarray, steps: np.ndarray) -> np.ndarray:
        """Differences (k, k) of the gradient of all terms but collision, over a step of each free number."""
        return kernels.effort_curvature(free, *self.parts, steps)

    def newton_step(
        self, now: Evaluation, inverse: np.ndarray, reach: np.ndarray, search: LineSearch, damping: float
    ) -> tuple[Evaluation, np.ndarray] | None:
        """The next point of BFGS and the inverse Hessian there; None where J does not fall along the direction."""
        rule = (search.armijo, search.low, search.high, search.tries)
        found, free, gradient, inverse, *cost = kernels.newton_step(
            now.free, now.gradient, inverse, now.cost.total, reach, *self.parts, rule, damping
        )
        return (Evaluation(free, PlanCost(*cost), gradient), inverse) if found else None

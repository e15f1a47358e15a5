"""J of Eq. 2 in one compiled call, where robot, field and terms are all known to kernels; else term by term.

See planner/kernels/quadrotor.py. What is not known (a term of one's own, another robot, a composite field) is evaluated
by objective.py with the same result.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from nerfnav.planner.border import reach_of
from nerfnav.planner.kernels import quadrotor as kernels
from nerfnav.planner.kernels.descent import newton_steps
from nerfnav.planner.steps import PlanCost
from nerfnav.planner.terms.collision import COLLISION
from nerfnav.planner.terms.control import CONTROL
from nerfnav.planner.terms.limits import LIMITS
from nerfnav.planner.terms.outside import OUTSIDE
from nerfnav.planner.terms.risk import RISK, danger_of
from nerfnav.planner.terms.term import CostTerm, TermContext
from nerfnav.robots import FlatMap, Motion
from nerfnav.robots.quadrotor_map import QuadrotorMap

_KNOWN = (COLLISION, CONTROL, LIMITS, OUTSIDE, RISK)
_AT_ONCE = 10
"""Steps of a search that are made in one call: they count from its start, so that none is made for nothing where a
search is left after a multiple of it."""


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
class SearchRule:
    """What a compiled search asks for, see NewtonConfig."""

    iterations: int
    """At most so many steps."""
    line: LineSearch
    """How long a step is."""
    damping: float
    """Least share of the curvature that is expected along a step."""
    settled: tuple[int, float, float]
    """Patience, tolerance and least."""

    @property
    def numbers(self) -> tuple:
        """As the kernel has them."""
        line = self.line
        return ((line.armijo, line.low, line.high, line.tries), self.damping, *self.settled)


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
        space = (*field.density_grid, *danger_of(context), reach_of(context.body))
        return cls(((*flat.constants, gamma), body, space, weighed))

    def __call__(self, free: np.ndarray) -> Evaluation:
        """J and its gradient."""
        gradient = np.empty(len(free))
        return Evaluation(free, PlanCost(*kernels.evaluate(free, *self.parts, gradient)), gradient)

    def of_motion(self, motion: Motion) -> PlanCost:
        """J of a motion that is there."""
        states = motion.states
        parts = (states.position, states.velocity, states.rotation, states.body_rate, motion.actions)
        arrays = tuple(part.double().contiguous().numpy() for part in parts)
        return PlanCost(*kernels.evaluate_motion(arrays, *self.parts))

    def effort_curvature(self, free: np.ndarray, steps: np.ndarray) -> np.ndarray:
        """Differences (k, k) of the gradient of all terms but collision, over a step of each free number."""
        return kernels.effort_curvature(free, *self.parts, steps)

    def steps(
        self, start: Evaluation, inverse: np.ndarray, reach: np.ndarray, rule: SearchRule
    ) -> Iterator[tuple[Evaluation, bool]]:
        """Where BFGS goes from a start and the inverse Hessian there, and whether J has settled there.

        A few steps are made in one call, before the first of them is yielded.
        """
        count = len(start.free)
        trace = tuple(np.empty((rule.iterations + 1, width)) for width in (count, count, 4))
        cost = start.cost
        trace[0][0], trace[1][0] = start.free, start.gradient
        trace[2][0] = cost.collision, cost.control, cost.limits, cost.risk
        inverses, at, settled, fresh = (inverse.copy(), inverse), 0, False, True
        while at < rule.iterations and not settled:
            before, until = at, min((at + 1) // _AT_ONCE * _AT_ONCE + _AT_ONCE - 1, rule.iterations)
            at, settled, fresh = newton_steps(trace, at, until, fresh, inverses, reach, self.parts, rule.numbers)
            told = slice(min(before + 1, at), at + 1)  # the last one again where J does not fall at all
            rows = zip(range(told.start, at + 1), trace[0][told], trace[1][told], trace[2][told].tolist(), strict=True)
            for step, free, gradient, terms in rows:
                yield Evaluation(free, PlanCost(*terms), gradient), settled and step == at

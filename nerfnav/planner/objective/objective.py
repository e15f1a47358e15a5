"""J and its gradient by the free numbers: what the fast planner minimises.

    forward: free -> motion    each term: motion -> its value and derivative    backward: dJ / d motion -> dJ / d free

The terms are those of terms/: compiled where they bring a kernel, else by autograd. Their torch values stay the
reference; tests hold both equal.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from nerfnav.planner.fused import Evaluation, FusedObjective
from nerfnav.planner.route import Route
from nerfnav.planner.steps import OWN, PlanCost, TermCost
from nerfnav.planner.terms.autograd import AutogradKernel
from nerfnav.planner.terms.term import Adjoint, CostTerm, Kernel, TermContext
from nerfnav.robots import FlatMap


@dataclass
class _Timed:
    """A term that was added, and how long it takes."""

    name: str
    kernel: Kernel
    seconds: float = 0.0
    calls: int = 0

    def __call__(self, flat: FlatMap, by: Adjoint) -> TermCost:
        """Its weighted value; adds its derivatives."""
        begun = perf_counter()
        value = self.kernel(flat, by)
        self.seconds, self.calls = self.seconds + perf_counter() - begun, self.calls + 1
        return TermCost(self.name, value, 1e3 * self.seconds / self.calls)


class Objective:
    """J of one robot along one route in one field."""

    def __init__(
        self, context: TermContext, route: Route, terms: Iterable[CostTerm], flat: FlatMap | None = None
    ) -> None:
        """Sum up `terms` for motions along `route`; `flat` saves making the robot's flatness map again."""
        terms = tuple(terms)
        self._map = flat or context.robot.flat_map(route.start, route.goal, route.steps, route.dt)
        self.fused = FusedObjective.of(context, terms, self._map)
        if self.fused is not None:
            return
        self._own: list[tuple[int, Kernel]] = []
        self._added: list[_Timed] = []
        self._cheap: list[Kernel] = []
        for term in terms:
            kernel = _kernel_of(term, context, route)
            if term.name in OWN:
                self._own.append((OWN[term.name], kernel))
            else:
                self._added.append(_Timed(term.name, kernel))
            if term.preconditions:
                self._cheap.append(kernel)

    def __call__(self, free: np.ndarray) -> Evaluation:
        """J with all its terms."""
        if self.fused is not None:
            return self.fused(free)
        flat, by, own = self._map, self._forward(free), [0.0] * 4
        for place, kernel in self._own:
            own[place] += kernel(flat, by)
        added = tuple([timed(flat, by) for timed in self._added])
        return Evaluation(free, PlanCost(*own, added=added), self._backward(by))

    def effort_curvature(self, free: np.ndarray, steps: np.ndarray) -> np.ndarray:
        """Differences (k, k) of `effort_gradient` over a step of each free number, each divided by its step."""
        if self.fused is not None:
            return self.fused.effort_curvature(free, steps)
        here = self.effort_gradient(free)
        ahead = np.stack([self.effort_gradient(free + step) for step in np.diag(steps)])
        return (ahead - here) / steps[:, None]

    def effort_gradient(self, free: np.ndarray) -> np.ndarray:
        """The gradient of the terms for preconditioning alone: cheap, and most of the curvature of J."""
        by = self._forward(free)
        for kernel in self._cheap:
            kernel(self._map, by)
        return self._backward(by)

    def _forward(self, free: np.ndarray) -> Adjoint:
        flat = self._map
        flat.forward(free)
        times = len(flat.position)
        # np.zeros takes a fifth of the time of np.zeros_like, and this is asked for some hundred times in a plan
        return Adjoint(free, np.zeros((times, 3)), np.zeros((times, 3)), np.zeros(flat.action.shape))

    def _backward(self, by: Adjoint) -> np.ndarray:
        gradient = self._map.backward(by.position, by.rotation, by.action)
        return gradient if by.by_free is None else gradient + by.by_free


def _kernel_of(term: CostTerm, context: TermContext, route: Route) -> Kernel:
    if term.kernel is None:
        return AutogradKernel(term, context, route)
    return term.kernel(context, term.weighed(context.weights))

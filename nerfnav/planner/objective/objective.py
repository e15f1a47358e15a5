"""Objective: J of Eq. 2 and its gradient by the free numbers, as the fast planner minimises it.

    forward: free -> motion    each term: motion -> its value and derivative    backward: dJ / d motion -> dJ / d free

Three ways lead to the same result; tests hold them equal to the terms' torch values, which are the reference:

- `FusedObjective`: one compiled call (kernels/quadrotor.py), where robot, field and terms are all known to kernels;
  terms beside these are added to it;
- `Objective`: term by term, each by its own kernel, for another robot, a composite field or a term of one's own;
- `AutogradKernel`: a term that brings no kernel, by autograd; slower by a part of a millisecond or more.

By autograd a term is differentiated by the parts of the motion: positions, attitudes and actions go on through the
compiled flatness map like those of every other term. The map's adjoint takes no velocities and body rates; a term
that looks at these is differentiated through the robot's own `motion` for them.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Protocol, final, runtime_checkable

import numpy as np
import torch
from torch import Tensor

from nerfnav.planner.kernels import quadrotor as kernels
from nerfnav.planner.space.border import reach_of
from nerfnav.planner.steps import COST_FIELDS, PlanCost, TermCost
from nerfnav.planner.terms.collision import COLLISION
from nerfnav.planner.terms.control import CONTROL
from nerfnav.planner.terms.delay import DELAY
from nerfnav.planner.terms.limits import LIMITS
from nerfnav.planner.terms.movers import mover_arguments
from nerfnav.planner.terms.outside import OUTSIDE
from nerfnav.planner.terms.risk import RISK, chance_grid_of
from nerfnav.planner.terms.term import Adjoint, CostTerm, Kernel, TermContext
from nerfnav.planner.trajectory import Route, motion_of
from nerfnav.robots import FlatMap, Motion, RigidState
from nerfnav.robots.quadrotor import QuadrotorMap


@final
class AutogradKernel:
    """Term by autograd in place of a compiled one, in double precision."""

    def __init__(self, term: CostTerm, context: TermContext, route: Route) -> None:
        """Differentiate a term for motions along a route."""
        self._term, self._context, self._route = term, context, route.to(torch.float64)

    def __call__(self, flat: FlatMap, by: Adjoint) -> float:
        """Implement Kernel."""
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
        """Differentiate by the free numbers (k), from the derivatives by velocities and body rates."""
        free = torch.from_numpy(at.copy()).requires_grad_()
        states = motion_of(self._context.robot, free, self._route).states
        pairs = [(states.velocity, by_velocity), (states.body_rate, by_rate)]
        needed = [(part, by) for part, by in pairs if by is not None and part.requires_grad]
        if not needed:
            return np.zeros_like(at)
        outputs, weights = zip(*needed, strict=True)
        (gradient,) = torch.autograd.grad(outputs, free, weights)
        return gradient.numpy()


def _in_tangent(rotation: np.ndarray, by_matrix: np.ndarray) -> np.ndarray:
    """Convert derivatives by attitude matrices to those in their tangents (n, 3): <G, R [d]x> = g . d."""
    a = np.swapaxes(rotation, -1, -2) @ by_matrix
    return np.stack([a[:, 2, 1] - a[:, 1, 2], a[:, 0, 2] - a[:, 2, 0], a[:, 1, 0] - a[:, 0, 1]], -1)


_KNOWN = (COLLISION, CONTROL, LIMITS, OUTSIDE, RISK)


@runtime_checkable
class DensityGrid(Protocol):
    """Field whose densities kernels find in a grid."""

    @property
    def density_grid(self) -> tuple[np.ndarray, ...]:
        """Return values, leaps, lower corner [m], nodes per metre, scale of densities, and both corners of the box
        [m]."""
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
class FusedObjective:
    """J of a quadrotor in a grid."""

    parts: tuple
    """Arguments of the kernels: task, body, space, weights."""

    @classmethod
    def of(cls, context: TermContext, terms: Sequence[CostTerm], flat: FlatMap) -> "FusedObjective | None":
        """Make J for a map between two ends; None where the kernels do not have all that it takes."""
        field, weights = context.field, context.weights
        moving = next((term for term in terms if term.fused is not None), None)
        late = any(term is DELAY for term in terms)
        standing = [term for term in terms if term is not moving and term is not DELAY]
        counted = len(standing) == len(_KNOWN) and all(any(term is known for term in standing) for known in _KNOWN)
        if not (counted and isinstance(flat, QuadrotorMap) and isinstance(field, DensityGrid)):
            return None
        gamma = CONTROL.weighed(weights) * np.array(context.robot.action_weights)
        fractions = (np.arange(weights.samples_per_step) + 0.5) / weights.samples_per_step
        body = (context.body.points_body.double().cpu().numpy(), fractions)
        weighing = (COLLISION, LIMITS, OUTSIDE, RISK, moving, DELAY if late else None)
        weighed = tuple(0.0 if term is None else float(term.weighed(weights)) for term in weighing)
        steps = len(flat.action)
        movers = mover_arguments(None, 0.0, context, steps, flat.dt)
        if moving is not None and moving.fused is not None:
            movers = moving.fused(context, steps, flat.dt)
        space = (*field.density_grid, *chance_grid_of(context), reach_of(context.body), movers)
        return cls(((*flat.constants, gamma), body, space, weighed))

    def __call__(self, free: np.ndarray) -> Evaluation:
        """Evaluate J and its gradient."""
        gradient = np.empty(len(free))
        return Evaluation(free, PlanCost(*kernels.evaluate(free, *self.parts, gradient)), gradient)

    def of_motion(self, motion: Motion) -> PlanCost:
        """Evaluate J of a motion."""
        states = motion.states
        parts = (states.position, states.velocity, states.rotation, states.body_rate, motion.actions)
        arrays = tuple(part.double().contiguous().numpy() for part in parts)
        return PlanCost(*kernels.evaluate_motion(arrays, *self.parts))

    def effort_curvature(self, free: np.ndarray, steps: np.ndarray) -> np.ndarray:
        """Compute differences (k, k) of the gradient of all terms but collision, over a step of each free number."""
        return kernels.effort_curvature(free, *self.parts, steps)


@dataclass
class _Timed:
    """Added term, with the time that it takes."""

    name: str
    kernel: Kernel
    seconds: float = 0.0
    calls: int = 0

    def __call__(self, flat: FlatMap, by: Adjoint) -> TermCost:
        """Evaluate the weighted term, and add its derivatives."""
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
        known = [term for term in terms if term in (*_KNOWN, DELAY) or term.fused is not None]
        beside = [term for term in terms if term not in known]
        self._base = None
        if not any(term.preconditions for term in beside):
            self._base = FusedObjective.of(context, known, self._map)
        self.fused = None if beside else self._base
        if self._base is not None:
            terms = tuple(beside)
        self._own: list[tuple[int, Kernel]] = []
        self._added: list[_Timed] = []
        self._cheap: list[Kernel] = []
        for term in terms:
            kernel = _kernel_of(term, context, route)
            if term.name in COST_FIELDS:
                self._own.append((COST_FIELDS[term.name], kernel))
            else:
                self._added.append(_Timed(term.name, kernel))
            if term.preconditions:
                self._cheap.append(kernel)

    def __call__(self, free: np.ndarray) -> Evaluation:
        """Evaluate J with all its terms."""
        if self.fused is not None:
            return self.fused(free)
        base = None if self._base is None else self._base(free)
        flat, by, own = self._map, self._forward(free), [0.0] * len({*COST_FIELDS.values()})
        for place, kernel in self._own:
            own[place] += kernel(flat, by)
        added = tuple([timed(flat, by) for timed in self._added])
        if base is not None:
            return Evaluation(free, replace(base.cost, added=added), base.gradient + self._backward(by))
        return Evaluation(free, PlanCost(*own, added=added), self._backward(by))

    def effort_curvature(self, free: np.ndarray, steps: np.ndarray) -> np.ndarray:
        """Compute differences (k, k) of `effort_gradient` over a step of each free number, each divided by its step."""
        if self._base is not None:
            return self._base.effort_curvature(free, steps)
        here = self.effort_gradient(free)
        ahead = np.stack([self.effort_gradient(free + step) for step in np.diag(steps)])
        return (ahead - here) / steps[:, None]

    def effort_gradient(self, free: np.ndarray) -> np.ndarray:
        """Compute the gradient of the terms for preconditioning alone: cheap, and most of the curvature of J."""
        by = self._forward(free)
        for kernel in self._cheap:
            kernel(self._map, by)
        return self._backward(by)

    def _forward(self, free: np.ndarray) -> Adjoint:
        flat = self._map
        flat.forward(free)
        times = len(flat.position)
        # np.zeros takes a fifth of the time of np.zeros_like, and a plan makes some hundred of these
        return Adjoint(free, np.zeros((times, 3)), np.zeros((times, 3)), np.zeros(flat.action.shape))

    def _backward(self, by: Adjoint) -> np.ndarray:
        gradient = self._map.backward(by.position, by.rotation, by.action)
        return gradient if by.by_free is None else gradient + by.by_free


def _kernel_of(term: CostTerm, context: TermContext, route: Route) -> Kernel:
    if term.kernel is None:
        return AutogradKernel(term, context, route)
    return term.kernel(context, term.weighed(context.weights))

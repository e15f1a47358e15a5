"""Cost term: a weighted functional of a motion, with its derivative; J is the sum of all terms.

    J(W) = sum over terms of  weight * value(context, motion of W)

The value is written in torch and is the reference: `evaluate` sums it for every report and judge. A term may bring a
compiled twin, its `kernel`, for the fast planner; the derivative of one that brings none is taken by autograd there
(objective/objective.py).
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import lru_cache
from time import perf_counter

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.field import Field
from nerfnav.planner.risk.costs import CostWeights
from nerfnav.planner.risk.tracking_error import PAPER_RISK_CONTEXT, RiskContext
from nerfnav.planner.steps import PlanCost, TermCost
from nerfnav.robots import Body, FlatMap, Motion, Robot


@dataclass(frozen=True)
class TermContext:
    """Context of a term: its inputs besides the motion."""

    field: Field
    """Field in which the robot moves."""
    robot: Robot
    """Robot that moves."""
    weights: CostWeights
    """Weights of the terms of Eq. 2, density of their samples, and room around the body."""
    risk_context: RiskContext = PAPER_RISK_CONTEXT
    """Properties of the flight: time steps, and the noise to come."""
    points: int | None = None
    """Number of well-spaced body points that stand for the body; None: all of them."""

    @property
    def body(self) -> Body:
        """Return the robot's body with the room of the weights, and so many of its points."""
        return _body(self.robot, self.weights.margin, self.points)


@lru_cache(maxsize=32)
def _body(robot: Robot, margin: float, points: int | None) -> Body:
    """Make the body once for each robot: every replan needs it."""
    body = robot.body_with_room(margin)
    return body if points is None else replace(body, points_body=select_spaced(body.points_body, points), push=None)


@dataclass(slots=True)
class Adjoint:
    """dJ at one point of the search, by what a flatness map gives: arrays to which the terms add theirs."""

    free: np.ndarray
    """The point: free numbers (k)."""
    position: np.ndarray
    """By the positions (N + 1, 3)."""
    rotation: np.ndarray
    """By the attitudes (N + 1, 3), in their tangents."""
    action: np.ndarray
    """By the actions (N, a)."""
    by_free: np.ndarray | None = None
    """By the free numbers (k), where a term computes that itself."""


Kernel = Callable[[FlatMap, Adjoint], float]
"""Weighted term at the last motion of a map; adds its derivatives to the adjoint."""


@dataclass(frozen=True)
class CostTerm:
    """Term of J: a name, a value, a weight and perhaps a compiled twin."""

    name: str
    """Name in reports."""
    value: Callable[[TermContext, Motion], Float[Tensor, "*batch"]]
    """Value without the weight: a differentiable functional, one number for each motion."""
    weight: float | None = 1.0
    """Weight; None: the field of CostWeights that has its name."""
    kernel: Callable[[TermContext, float], Kernel] | None = None
    """Constructor of its compiled twin for a context and a weight; None: by autograd, which takes a part of a
    millisecond or more for each iteration, see TermCost.ms."""
    fused: Callable[[TermContext, int, float], tuple] | None = None
    """Arguments of its kernel for so many steps of dt [s], where that is part of the whole J in one call."""
    preconditions: bool = False
    """True if the fast planner's first inverse Hessian has its curvature: for terms that are cheap and nearly
    quadratic."""

    def weighed(self, weights: CostWeights) -> float:
        """Return its weight among the given ones."""
        return getattr(weights, self.name) if self.weight is None else self.weight

    def cost(self, context: TermContext, motion: Motion) -> Float[Tensor, "*batch"]:
        """Evaluate the weighted term. Raises InvalidInputError, in one sentence, for what is not one number for each
        motion."""
        value, batch = self.value(context, motion), motion.actions.shape[:-2]
        if not isinstance(value, Tensor) or value.shape != batch:
            found = f"shape {tuple(value.shape)}" if isinstance(value, Tensor) else type(value).__name__
            raise InvalidInputError(
                f"the cost term {self.name!r} must give a tensor of shape {tuple(batch)}, one number for each motion, "
                f"not {found}: sum over times and axes"
            )
        return self.weighed(context.weights) * value


def select_spaced(points: Float[Tensor, "n 3"], count: int) -> Float[Tensor, "m 3"]:
    """Select points by farthest-point sampling, the outermost first (Gonzalez, 1985)."""
    all_points = points.double().cpu().numpy()
    distance = -np.square(all_points - all_points.mean(0)).sum(-1)
    chosen = [int(distance.argmin())]
    distance = np.square(all_points - all_points[chosen[0]]).sum(-1)
    while len(chosen) < min(count, len(all_points)):
        chosen.append(int(distance.argmax()))
        distance = np.minimum(distance, np.square(all_points - all_points[chosen[-1]]).sum(-1))
    return points[torch.tensor(chosen, device=points.device)]


@dataclass(frozen=True)
class Evaluated:
    """Weighted terms of J as differentiable tensors."""

    values: dict[str, Float[Tensor, "*batch"]]
    """Values by name of the term."""
    ms: dict[str, float]
    """Times by name of the term [ms]."""

    @property
    def total(self) -> Float[Tensor, "*batch"]:
        """Sum the terms: J."""
        return torch.stack(list(self.values.values())).sum(0)

    def numbers(self) -> PlanCost:
        """Convert to plain numbers; for one motion only."""
        return PlanCost.of(TermCost(name, value.item(), self.ms[name]) for name, value in self.values.items())


def evaluate(terms: Iterable[CostTerm], context: TermContext, motion: Motion) -> Evaluated:
    """Evaluate all terms of J for one motion or a batch of motions."""
    values, ms = {}, {}
    for term in terms:
        begun = perf_counter()
        values[term.name] = term.cost(context, motion)
        ms[term.name] = 1e3 * (perf_counter() - begun)
    return Evaluated(values, ms)

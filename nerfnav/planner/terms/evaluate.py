"""J in torch: the reference of the compiled objective, and what every report and judge asks."""

from collections.abc import Iterable
from dataclasses import dataclass
from time import perf_counter

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.planner.steps import PlanCost, TermCost
from nerfnav.planner.terms.term import CostTerm, TermContext
from nerfnav.robots import Motion


@dataclass(frozen=True)
class Evaluated:
    """The weighted terms of J as differentiable tensors."""

    values: dict[str, Float[Tensor, "*batch"]]
    """Name of a term to what it comes to."""
    ms: dict[str, float]
    """Name of a term to the time that it took [ms]."""

    @property
    def total(self) -> Float[Tensor, "*batch"]:
        """J."""
        return torch.stack(list(self.values.values())).sum(0)

    def numbers(self) -> PlanCost:
        """The same as plain numbers; for one motion only."""
        return PlanCost.of(TermCost(name, value.item(), self.ms[name]) for name, value in self.values.items())


def evaluate(terms: Iterable[CostTerm], context: TermContext, motion: Motion) -> Evaluated:
    """All terms of J for one motion or a batch of motions."""
    values, ms = {}, {}
    for term in terms:
        begun = perf_counter()
        values[term.name] = term.cost(context, motion)
        ms[term.name] = 1e3 * (perf_counter() - begun)
    return Evaluated(values, ms)

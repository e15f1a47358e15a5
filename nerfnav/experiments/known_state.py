"""State feedback: an estimator that is told the truth, as a bound on what any filter could do."""

from collections.abc import Iterator
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.estimator import Belief, FilterOutcome, FilterStep, StateNoise
from nerfnav.navigation import Simulator

KNOWN = StateNoise.isotropic(1e-8)
"""Spread of a belief that is the truth: not zero, for covariances are inverted."""


@dataclass(frozen=True)
class KnownState:
    """An estimator that looks at the simulator's state instead of at pictures."""

    simulator: Simulator
    """Knows where the robot is."""

    def update(
        self, belief: Belief, image: Tensor | None, action: Float[Tensor, " a"], dt: float, generator: torch.Generator
    ) -> Iterator[FilterStep]:
        """The true state, whatever the arguments (see Estimator)."""
        truth = Belief(self.simulator.state, KNOWN.covariance())
        yield FilterStep(
            0, truth.mean, 0.0, 0.0, torch.zeros(0, 2, dtype=torch.long), torch.zeros(0),
            posterior=truth, outcome=FilterOutcome.UPDATED,
        )  # fmt: skip

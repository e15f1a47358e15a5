"""Estimator protocol: from a belief, a picture and an action to the next belief."""

from collections.abc import Iterator
from typing import Protocol, runtime_checkable

import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from nerfnav.estimator.core.belief import Belief
from nerfnav.estimator.core.filter_step import FilterStep
from nerfnav.robots import ProcessNoise


@runtime_checkable
class Estimator(Protocol):
    """Anything that follows the robot's state."""

    def update(
        self,
        belief: Belief,
        image: UInt8[Tensor, "height width 3"] | None,
        action: Float[Tensor, " a"],
        dt: float,
        generator: torch.Generator,
    ) -> Iterator[FilterStep]:
        """The belief after an action of `dt` [s] and the picture taken then; the last step carries it."""
        ...


@runtime_checkable
class Corrector(Protocol):
    """An estimator that takes a picture, whatever has moved the belief until then."""

    @property
    def trust_dynamics(self) -> bool:
        """Whether the prediction counts in the posterior; False: it is the start only."""
        ...

    def correct(
        self,
        prediction: Belief,
        image: UInt8[Tensor, "height width 3"] | None,
        generator: torch.Generator,
        noise: ProcessNoise | None = None,
    ) -> Iterator[FilterStep]:
        """The belief after a picture; `noise` is what the prediction holds of process noise, where that is told."""
        ...

"""Latency compensation: pictures that come late correct the belief of when they were taken, which is then moved on.

Both times by what the inertial unit has measured meanwhile: the estimator's robot is a Strapdown.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.errors import InvalidInputError
from nerfnav.estimator import Belief, Estimator, FilterStep, StateNoise
from nerfnav.estimator.predict import predict
from nerfnav.robots import Robot


@dataclass(frozen=True)
class LatePictures:
    """An estimator by another one, for pictures that are late by less than a time step."""

    estimator: Estimator
    """Knows nothing of it."""
    robot: Robot
    """What it takes for the robot: a Strapdown."""
    felt: Callable[[], tuple[Tensor, Tensor]]
    """Inertial increments of the last time step until its picture was taken, and after that."""
    delay_s: float
    """By how much pictures are late [s]."""
    noise: StateNoise
    """What disturbs the robot in a whole time step."""

    def update(
        self, belief: Belief, image: Tensor | None, action: Float[Tensor, " a"], dt: float, generator: torch.Generator
    ) -> Iterator[FilterStep]:
        """See Estimator. Raises InvalidInputError where pictures come later than a time step."""
        late, spread = self.delay_s, self.noise.std() * (self.delay_s / dt) ** 0.5
        if late >= dt:
            raise InvalidInputError(f"pictures that are {late:.3g} s late need time steps longer than {dt:g} s")
        noise, (before, after) = StateNoise(*spread[::3].tolist()), self.felt()
        for step in self.estimator.update(belief, image, before, dt - late, generator):
            posterior = step.posterior
            moved = None if posterior is None else predict(posterior, after, self.robot, late, noise)
            yield replace(step, posterior=moved)

"""Latency compensation: pictures that come late correct the belief of when they were taken, which is then moved on.

Both times by what the inertial unit has measured meanwhile, whose biases are learned on the way
(inertial/inertial_motion.py): they last, and taken for white noise they would push a belief to the same side again
and again.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.estimator import Belief, Corrector, FilterUpdate
from nerfnav.inertial import ImuConfig, inertial_motion
from nerfnav.inertial.inertial_motion import InertialBelief
from nerfnav.navigation.physical.inertial import InertialInterval
from nerfnav.robots import MeasuredNoise, ProcessNoise


@dataclass
class LatencyCompensation:
    """An estimator by another one, for pictures that are late by less than a time step."""

    estimator: Corrector
    """Knows nothing of it."""
    felt: Callable[[], tuple[InertialInterval, InertialInterval]]
    """What was measured in the last time step until its picture was taken, and after that."""
    delay_s: float
    """By how much pictures are late [s]."""
    unit: ImuConfig
    """How well it is measured."""
    _last: InertialBelief | None = field(default=None, init=False)

    def update(
        self, belief: Belief, image: Tensor | None, action: Float[Tensor, " a"], dt: float, generator: torch.Generator
    ) -> FilterUpdate:
        """See Estimator. Raises InvalidInputError where pictures come later than a time step."""
        if self.delay_s >= dt:
            raise InvalidInputError(
                f"pictures that are {self.delay_s:.3g} s late need time steps longer than {dt:g} s"
            )
        before, after = self.felt()
        then, noise = self._moved(self._known(belief), before)
        held = MeasuredNoise(noise.to(belief.covariance))
        result = yield from self.estimator.correct(then.belief, image, generator, held)
        self._last, _ = self._moved(self._corrected(then, result.posterior), after)
        return replace(result, posterior=self._last.belief)

    @property
    def trust_dynamics(self) -> bool:
        """See Corrector."""
        return self.estimator.trust_dynamics

    def correct(
        self, prediction: Belief, image: Tensor | None, generator: torch.Generator, noise: ProcessNoise | None = None
    ) -> FilterUpdate:
        """See Corrector: of a robot that rests, pictures are not late."""
        return self.estimator.correct(prediction, image, generator, noise)

    def _known(self, belief: Belief) -> InertialBelief:
        """A belief with what is known of the biases."""
        if self._last is None:
            return InertialBelief.begin(belief, self.unit)
        return self._last if self._last.belief is belief else self._last.restart_with(belief)  # doubted, or found anew

    def _corrected(self, then: InertialBelief, posterior: Belief) -> InertialBelief:
        """With what a picture has told; of biases it tells nothing where the prediction was the start alone."""
        return then.corrected(posterior) if self.estimator.trust_dynamics else then.restart_with(posterior)

    def _moved(self, last: InertialBelief, felt: InertialInterval) -> tuple[InertialBelief, Tensor]:
        """The belief after what was felt, and the noise in it."""
        if felt.duration == 0:
            return last, torch.zeros_like(last.belief.covariance)
        return inertial_motion.predict(last, felt.without(last.biases, self.unit), self.unit)

"""Latency compensation: a late picture corrects the belief of the time at which it was taken.

Inertial measurements propagate the belief to that time and from there. Their biases are estimated on the way
(inertial/inertial_motion.py): they last, and as white noise they would push a belief to the same side again and again.
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
    """Estimator for pictures that are late by less than a time step, on top of another one."""

    estimator: Corrector
    """The other one, for pictures that are not late."""
    felt: Callable[[], tuple[InertialInterval, InertialInterval]]
    """Inertial measurements of the last time step until its picture was taken, and after that."""
    delay_s: float
    """Latency of pictures [s]."""
    unit: ImuConfig
    """Noise of the measurements."""
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
        then, noise = self._propagate(self._with_biases(belief), before)
        held = MeasuredNoise(noise.to(belief.covariance))
        result = yield from self.estimator.correct(then.belief, image, generator, held)
        # biases stay where the prediction was the start alone
        corrected = then.corrected if self.estimator.trust_dynamics else then.restart_with
        self._last, _ = self._propagate(corrected(result.posterior), after)
        return replace(result, posterior=self._last.belief)

    @property
    def trust_dynamics(self) -> bool:
        """Return whether the prediction counts in the posterior, see Corrector."""
        return self.estimator.trust_dynamics

    def correct(
        self, prediction: Belief, image: Tensor | None, generator: torch.Generator, noise: ProcessNoise | None = None
    ) -> FilterUpdate:
        """Correct by a picture of a robot at rest, which is not late (see Corrector)."""
        return self.estimator.correct(prediction, image, generator, noise)

    def _with_biases(self, belief: Belief) -> InertialBelief:
        """Add the estimated biases to a belief."""
        if self._last is None:
            return InertialBelief.begin(belief, self.unit)
        return self._last if self._last.belief is belief else self._last.restart_with(belief)  # widened, or relocalized

    def _propagate(self, last: InertialBelief, felt: InertialInterval) -> tuple[InertialBelief, Tensor]:
        """Propagate a belief by inertial measurements; return it, and the noise of the propagation."""
        if felt.duration == 0:
            return last, torch.zeros_like(last.belief.covariance)
        return inertial_motion.predict(last, felt.without(last.biases, self.unit), self.unit)

"""Gyroscopes of a robot in the paper's world: they measure the turn of each time step and the body rate at its end.

The paper's noise displaces all of a state after each time step (simulator.py). Gyroscopes measure what it does to
attitude and body rate, R' = R turn and w'; position and velocity stay unknown. Their noise is that of the physical
world's unit, white and without a bias. There, latency_compensation.py takes the place of this.
"""

from dataclasses import dataclass, field, replace
from typing import ClassVar

import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.estimator import Belief, FilterUpdate, Predictor, correct_masked, transition
from nerfnav.geometry import so3
from nerfnav.robots import ATTITUDE, BODY_RATE, ProcessNoise, RigidState, Robot, StateNoise

GYROSCOPE_NOISE = 5e-4
"""White noise [rad/s/sqrt(Hz)] of small gyroscopes on a frame that shakes."""
_HZ = 500.0
"""Rate of measurements [1/s]: the last one gives the body rate."""
_SEED = 2**33
"""Added to the seed of a flight: seeds of flights and of their worlds are smaller."""


def measured_noise(noise: StateNoise, dt: float) -> StateNoise:
    """Return the process noise of a time step of `dt` [s] with that of gyroscopes in the place of what they measure."""
    return replace(noise, attitude_rad=GYROSCOPE_NOISE * dt**0.5, body_rate_radps=GYROSCOPE_NOISE * _HZ**0.5)


@dataclass
class Gyroscopes:
    """Gyroscopes of a simulated robot, with their last measurement."""

    seed: int
    """Seed of the flight. Its noise is the same with and without gyroscopes."""
    turn: Float[Tensor, "3 3"] = field(default_factory=lambda: torch.eye(3), init=False)
    """Turn of the last time step, from the body's axes at its end to those at its beginning."""
    rate: Float[Tensor, "3"] = field(default_factory=lambda: torch.zeros(3), init=False)
    """Body rate at its end [rad/s]."""

    def __post_init__(self) -> None:
        """Begin the draws of the errors."""
        self._generator = torch.Generator().manual_seed(_SEED + self.seed)

    def measure(self, before: RigidState, after: RigidState, dt: float) -> None:
        """Measure a time step of `dt` [s]."""
        error = measured_noise(StateNoise(), dt).sample(self._generator)
        self.turn = so3.project(before.rotation.T @ after.rotation @ so3.exp(error[ATTITUDE]))
        self.rate = after.body_rate + error[BODY_RATE]


@dataclass
class GyroscopeAided:
    """Estimator that predicts attitude and body rate by gyroscopes, on top of another one."""

    estimator: Predictor
    """The other one, with the process noise of `measured_noise`."""
    robot: Robot
    """Dynamics, for position and velocity."""
    gyroscopes: Gyroscopes
    """Measurements of the last time step."""
    takes_hidden: ClassVar[bool] = True
    """`correct` takes pixels that are not compared, where the other estimator does."""

    def update(
        self, belief: Belief, image: Tensor | None, action: Float[Tensor, " a"], dt: float, generator: torch.Generator
    ) -> FilterUpdate:
        """Predict by the measurements, then correct by the picture; see Estimator."""
        prediction, noise = self.predict(belief, action, dt)
        return self.correct(prediction, image, generator, noise)

    def predict(
        self, belief: Belief, action: Float[Tensor, " a"], dt: float, noise_factor: float = 1.0
    ) -> tuple[Belief, ProcessNoise]:
        """Predict position and velocity by the dynamics, attitude and body rate by the measurements; see Predictor.

        The error of the attitude is turned, that of the body rate is new: those rows of df/dx change.
        """
        turn, rate = (part.to(belief.mean.rotation) for part in (self.gyroscopes.turn, self.gyroscopes.rate))
        moved, noise = self.estimator.predict(belief, action, dt, noise_factor)
        _, jacobian = transition(self.robot, belief.mean.detach(), action.detach(), dt)
        mean = replace(moved.mean, rotation=so3.project(belief.mean.rotation @ turn), body_rate=rate)
        jacobian[ATTITUDE], jacobian[BODY_RATE] = 0, 0
        jacobian[ATTITUDE, ATTITUDE] = turn.T.to(jacobian)
        covariance = jacobian @ belief.covariance @ jacobian.T + noise.covariance().to(jacobian)
        return Belief(mean, 0.5 * (covariance + covariance.T)), noise

    @property
    def trust_dynamics(self) -> bool:
        """Return whether the prediction counts in the posterior, see Corrector."""
        return self.estimator.trust_dynamics

    def correct(
        self,
        prediction: Belief,
        image: UInt8[Tensor, "height width 3"] | None,
        generator: torch.Generator,
        noise: ProcessNoise | None = None,
        hidden: Tensor | None = None,
    ) -> FilterUpdate:
        """Correct a prediction by a picture, see Predictor."""
        return correct_masked(self.estimator, prediction, image, generator, noise, hidden)


def aid_by_gyroscopes(estimator: object, robot: Robot, gyroscopes: Gyroscopes) -> GyroscopeAided:
    """Put gyroscopes before an estimator. Raises InvalidInputError for one that cannot take a prediction."""
    if not isinstance(estimator, Predictor):
        raise InvalidInputError(
            f"{type(estimator).__name__} takes no prediction from elsewhere (nerfnav.estimator.Predictor): leave --imu "
            "out, or take the estimator 'fast'"
        )
    return GyroscopeAided(estimator, robot, gyroscopes)

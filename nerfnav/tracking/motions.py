"""Motion models of a camera between two pictures: its robot's dynamics, or an inertial measurement unit."""

from dataclasses import dataclass
from typing import Protocol

from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.estimator import Belief
from nerfnav.estimator.core.prediction import predict
from nerfnav.inertial import ImuConfig, inertial_motion
from nerfnav.robots import MeasuredNoise, ProcessNoise, RandomAcceleration, Robot
from nerfnav.tracking.frame import ImuMeasurements
from nerfnav.tracking.preintegration import preintegrate
from nerfnav.tracking.tracker_config import TrackerConfig


class CarrierMotion(Protocol):
    """Motion model that predicts between pictures."""

    def predict(self, belief: Belief, times: tuple[float, float], action: Tensor | None) -> tuple[Belief, ProcessNoise]:
        """Predict from the first of two times [s] to the second; returns also the process noise in it."""
        ...

    def corrected(self, prediction: Belief, posterior: Belief) -> None:
        """Learn from a picture that corrected the last prediction, perhaps a wider one."""
        ...

    def forget(self) -> None:
        """Reset what was learned."""
        ...


@dataclass(frozen=True)
class ModelMotion:
    """Dynamics of a robot, plus random acceleration."""

    robot: Robot
    """Carrier of the camera."""
    config: TrackerConfig
    """In metres: see `TrackerConfig.in_place`."""

    def predict(self, belief: Belief, times: tuple[float, float], action: Tensor | None) -> tuple[Belief, ProcessNoise]:
        """Predict by the dynamics; see CarrierMotion."""
        dt = times[1] - times[0]
        noise = RandomAcceleration(dt, self.config.linear, self.config.angular)
        action = self.robot.hold(belief.mean, dt) if action is None else action
        return predict(belief, action, self.robot, dt, noise), noise

    def corrected(self, prediction: Belief, posterior: Belief) -> None:
        """Learn nothing: the dynamics are fixed."""

    def forget(self) -> None:
        """Reset nothing: the dynamics are fixed."""


class InertialMotion:
    """Inertial measurement unit whose biases, and gravity, are estimated on the way (inertial_motion.py)."""

    def __init__(self, inertial: ImuMeasurements, config: ImuConfig | None = None) -> None:
        """Begin without biases; the default noise is that of the source."""
        self.inertial, self.config = inertial, ImuConfig().for_unit(inertial.noise) if config is None else config
        self.forget()

    def predict(self, belief: Belief, times: tuple[float, float], action: Tensor | None) -> tuple[Belief, ProcessNoise]:
        """Predict by the measurements, which hold the action. Raises InvalidInputError for times without them."""
        last = self.last
        if last is None:
            last = inertial_motion.InertialBelief.begin(belief, self.config)
        elif last.belief is not belief:  # found anew by a search
            last = last.restart_with(belief)
        measured = preintegrate(self.inertial, *times, last.biases, self.config)
        self.last, noise = inertial_motion.predict(last, measured, self.config)
        return self.last.belief, MeasuredNoise(noise.to(belief.covariance))

    def corrected(self, prediction: Belief, posterior: Belief) -> None:
        """Correct the biases by regression; see CarrierMotion."""
        assert self.last is not None, "what is corrected was predicted"
        self.last = self.last.corrected(posterior, prediction)

    def forget(self) -> None:
        """Reset the biases; see CarrierMotion."""
        self.last: inertial_motion.InertialBelief | None = None

    def check(self, time: float) -> None:
        """Raise InvalidInputError where the first picture, taken at a time [s], lies beside what was measured."""
        first, last = float(self.inertial.times[0]), float(self.inertial.times[-1])
        if not first - self.config.longest_gap <= time <= last + self.config.longest_gap:
            raise InvalidInputError(
                f"the first picture was taken at {time:.3f} s, and the inertial measurements are from {first:.3f} s to "
                f"{last:.3f} s: they must be of the same time, on the same clock"
            )

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
    """What predicts."""

    def predict(
        self, belief: Belief, times: tuple[float, float], action: Tensor | None
    ) -> tuple[Belief, ProcessNoise]:
        """The belief at the second of two times [s], from that at the first; and the process noise that is in it."""
        ...

    def corrected(self, prediction: Belief, posterior: Belief) -> None:
        """A picture has been held against a prediction of the last time, perhaps made less sure."""
        ...

    def forget(self) -> None:
        """Know nothing again."""
        ...


@dataclass(frozen=True)
class ModelMotion:
    """A robot's dynamics; what they do not say is random acceleration."""

    robot: Robot
    """What carries the camera."""
    config: TrackerConfig
    """In metres: see `TrackerConfig.in_place`."""

    def predict(
        self, belief: Belief, times: tuple[float, float], action: Tensor | None
    ) -> tuple[Belief, ProcessNoise]:
        """See CarrierMotion."""
        dt = times[1] - times[0]
        noise = RandomAcceleration(dt, self.config.linear, self.config.angular)
        action = self.robot.hold(belief.mean, dt) if action is None else action
        return predict(belief, action, self.robot, dt, noise), noise

    def corrected(self, prediction: Belief, posterior: Belief) -> None:
        """There is nothing to learn from it."""

    def forget(self) -> None:
        """There is nothing to forget."""


class InertialMotion:
    """An inertial measurement unit whose biases, and gravity, are learned on the way (inertial_motion.py)."""

    def __init__(self, inertial: ImuMeasurements, config: ImuConfig | None = None) -> None:
        """Nothing is known of its biases; by default it is as noisy as its source says."""
        self.inertial, self.config = inertial, ImuConfig().told(inertial.noise) if config is None else config
        self.forget()

    def predict(
        self, belief: Belief, times: tuple[float, float], action: Tensor | None
    ) -> tuple[Belief, ProcessNoise]:
        """See CarrierMotion; the action is in what is measured. Raises InvalidInputError for times not measured."""
        last = self.last
        if last is None:
            last = inertial_motion.InertialBelief.begin(belief, self.config)
        elif last.belief is not belief:  # found anew by a search
            last = last.restart_with(belief)
        measured = preintegrate(self.inertial, *times, last.biases, self.config)
        self.last, noise = inertial_motion.predict(last, measured, self.config)
        return self.last.belief, MeasuredNoise(noise.to(belief.covariance))

    def corrected(self, prediction: Belief, posterior: Belief) -> None:
        """See CarrierMotion: what is known of the biases follows."""
        assert self.last is not None, "what is corrected was predicted"
        self.last = self.last.corrected(posterior, prediction)

    def forget(self) -> None:
        """See CarrierMotion."""
        self.last: inertial_motion.InertialBelief | None = None

    def check(self, time: float) -> None:
        """Raise InvalidInputError where the first picture, taken at a time [s], lies beside what was measured."""
        first, last = float(self.inertial.times[0]), float(self.inertial.times[-1])
        if not first - self.config.longest_gap <= time <= last + self.config.longest_gap:
            raise InvalidInputError(
                f"the first picture was taken at {time:.3f} s, and the inertial measurements are from {first:.3f} s to "
                f"{last:.3f} s: they must be of the same time, on the same clock"
            )

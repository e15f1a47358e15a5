"""Motors and rotors: speeds that follow their commands with a lag, within limits, and the thrust that comes of them."""

from dataclasses import dataclass, field

import numpy as np

from nerfnav.navigation.physical.config import PhysicalConfig
from nerfnav.navigation.physical.rigid_body import Airframe
from nerfnav.navigation.physical.tracking import TrackingGains


@dataclass
class Powertrain:
    """Rotors at some speeds, at first those of hover."""

    frame: Airframe
    """What the robot is thought to be."""
    world: PhysicalConfig
    """Limits and lag."""
    gains: TrackingGains
    """How commands make up for the lag."""
    speeds: np.ndarray = field(init=False)
    """Of the rotors [rad/s]."""
    lift: float = 0.0
    """By how much the accelerometer says that the thrust pulls more than it should [m/s^2]."""
    _thrust: float = 0.0

    def __post_init__(self) -> None:
        """Hover."""
        count = len(self.frame.rotors)
        each = self.frame.mass * self.frame.gravity / count / self.frame.thrust_coefficient
        self.speeds = np.full(count, np.sqrt(each))
        self._inverse = np.linalg.pinv(self.frame.allocation)

    def spin(self, wanted: np.ndarray, dt: float) -> np.ndarray:
        """The thrust [N] and torque [N m] that come of `dt` [s] of wanting a thrust for each kg and a torque."""
        world, coefficient = self.world, self.frame.thrust_coefficient
        thrust = self.frame.mass * (wanted[0] - self.lift)
        each = self._inverse @ np.array([thrust, *wanted[1:]]) / coefficient
        aim = np.sqrt(np.maximum(each, 0.0))
        command = np.clip(self.speeds + self.gains.lead * (aim - self.speeds), world.slowest_radps, world.fastest_radps)
        self.speeds = command + (self.speeds - command) * np.exp(-dt / world.motor_lag_s)
        wrench = self.frame.allocation @ (coefficient * self.speeds**2)
        self._thrust = float(wrench[0])
        return wrench

    def feel(self, specific_force: float, dt: float) -> None:
        """Learn from the accelerometer, along the body's z axis [m/s^2]."""
        surplus = specific_force - self._thrust / self.frame.mass
        self.lift += (1 - np.exp(-dt * self.gains.lift)) * (surplus - self.lift)

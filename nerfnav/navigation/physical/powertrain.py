"""Motors and rotors: speeds that follow their commands with a lag, within limits, and the thrust that comes of them."""

from dataclasses import dataclass, field

import numpy as np

from nerfnav.navigation.physical.config import PhysicalConfig
from nerfnav.navigation.physical.geometric_controller import TrackingGains
from nerfnav.navigation.physical.rigid_body import Airframe


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

    def __post_init__(self) -> None:
        """Hover."""
        count = len(self.frame.rotors)
        each = self.frame.mass * self.frame.gravity / count / self.frame.thrust_coefficient
        self.speeds = np.full(count, np.sqrt(each))
        self._inverse = np.linalg.pinv(self.frame.allocation)

    def spin(self, wanted: np.ndarray, dt: float) -> np.ndarray:
        """The thrust [N] and torque [N m] that come of `dt` [s] of wanting a thrust for each kg and a torque.

        Where rotors reach their limits, tilting comes first, then thrust, and turning about the vertical last.
        """
        world, coefficient = self.world, self.frame.thrust_coefficient
        least, most = world.slowest_radps**2, world.fastest_radps**2
        lifting = np.array([self.frame.mass * wanted[0], wanted[1], wanted[2], 0.0])
        squares = self._inverse @ lifting / coefficient
        squares = squares + max(0.0, least - squares.min())
        squares = (squares - max(0.0, squares.max() - most)).clip(least, most)
        turning = self._inverse[:, 3] * wanted[3] / coefficient
        room = np.where(turning > 0, most - squares, squares - least)
        share = min(1.0, float((room / np.maximum(np.abs(turning), 1e-9)).min()))
        aim = np.sqrt((squares + share * turning).clip(least, most))
        command = np.clip(self.speeds + self.gains.lead * (aim - self.speeds), world.slowest_radps, world.fastest_radps)
        self.speeds = command + (self.speeds - command) * np.exp(-dt / world.motor_lag_s)
        return self.frame.allocation @ (coefficient * self.speeds**2)

"""How flights in the browser are flown."""

import math
from dataclasses import dataclass

from nerfnav.errors import InvalidInputError
from nerfnav.estimator.noise import StateNoise

GUST = StateNoise(position_m=0.05, velocity_mps=0.3, attitude_rad=0.05, body_rate_radps=0.3)
"""What one gust of wind does to the robot."""
_LARGEST_POSITION_M, _LARGEST_ATTITUDE_RAD, _LARGEST_PACE = 0.1, 0.2, 4.0
_SEEDS = 2**31


@dataclass(frozen=True)
class FlightSettings:
    """What a person may change about flights."""

    seed: int = 0
    """Seed of everything random."""
    position_noise_m: float = StateNoise.position_m
    """Standard deviation of what disturbs each coordinate of the position at each time step [m]."""
    attitude_noise_rad: float = StateNoise.attitude_rad
    """The same of the attitude [rad]; velocity and body rate are disturbed by half as much in their units."""
    open_loop: bool = False
    """Fly the first plan blindly."""
    pace: float = 0.0
    """How many times faster than in reality a flight may go; 0 is as fast as it is computed."""

    def check(self) -> None:
        """Raise InvalidInputError for numbers that no flight can have; what a browser sends can be anything."""
        if not 0 <= self.seed < _SEEDS:
            raise InvalidInputError(f"the seed must be a whole number from 0 to {_SEEDS - 1}")
        for name, value, largest in (
            ("position noise", self.position_noise_m, _LARGEST_POSITION_M),
            ("attitude noise", self.attitude_noise_rad, _LARGEST_ATTITUDE_RAD),
            ("speed", self.pace, _LARGEST_PACE),
        ):
            if not (math.isfinite(value) and 0 <= value <= largest):
                raise InvalidInputError(f"the {name} must be from 0 to {largest:g}")

    @property
    def noise(self) -> StateNoise:
        """What disturbs the robot at each time step, its rates by half as much (as in the paper)."""
        position, attitude = self.position_noise_m, self.attitude_noise_rad
        return StateNoise(position, 0.5 * position, attitude, 0.5 * attitude)

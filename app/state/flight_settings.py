"""How flights in the browser are flown."""

from dataclasses import dataclass

from nerfnav.estimator import StateNoise
from nerfnav.navigation import WorldName

GUST = StateNoise(position_m=0.05, velocity_mps=0.3, attitude_rad=0.05, body_rate_radps=0.3)
"""What one gust of wind does to the robot."""
LARGEST_SEED = 2**31 - 1
"""Seeds are whole numbers from 0 to this."""


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
    world: WorldName = "paper"
    """The paper's noise, or the physical world, whose disturbances are its own."""
    realtime: bool = False
    """Whether the world goes on while filter and planner compute."""
    pace: float = 0.0
    """How many times faster than in reality a flight may go; 0 is as fast as it is computed."""

    @property
    def noise(self) -> StateNoise:
        """What disturbs the robot at each time step, its rates by half as much (as in the paper)."""
        position, attitude = self.position_noise_m, self.attitude_noise_rad
        return StateNoise(position, 0.5 * position, attitude, 0.5 * attitude)

"""Parameters of the physical world, all in one record."""

from dataclasses import dataclass

from nerfnav.core.errors import InvalidInputError
from nerfnav.navigation.gyroscopes import GYROSCOPE_NOISE

LEASH_M = 0.1
"""How far off a robot may believe to be that still tracks its plan [m]: its own width."""

UNSEEN_M = 0.018
"""Standard deviation of a coordinate of the position from which a robot that sees nothing holds [m]: with this, the
truth is within 5 cm 95 times of 100 (chi-squared of 3 numbers). Inertial measurements alone are wrong by more after
half a second, and go on to be wrong in the same direction."""


@dataclass(frozen=True)
class PhysicalConfig:
    """A quadrotor of 250 g and 10 cm in moderate wind; rotors of others are scaled to them (simulator.py, `airframe`).

    Wind is scaled by what it does: the ratio of drag acceleration to gravity. Drag is linear in the airspeed, d v for
    each kg, and d hardly depends on a quadrotor's size: about 0.3 /s at 30 g (Foerster, "System identification of the
    Crazyflie 2.0", 2015), 0.4 to 0.5 /s at 0.6 kg (Faessler et al., "Differential flatness of quadrotor dynamics
    subject to rotor drag", 2018). So wind is taken as it is: 2 m/s push with 0.08 g, gusts to 4 m/s with 0.16 g.
    """

    control_hz: float = 500.0
    """Rate of the loop that tracks the plan, and of the integration [1/s]."""
    rotor_arm_m: float = 0.035
    """Distance of the rotors from the body's x and y axes [m]."""
    thrust_coefficient: float = 2.7e-7
    """Thrust of a rotor for its speed squared [N s^2]: hover at about 1,500 rad/s."""
    torque_coefficient: float = 3.4e-9
    """Drag torque of a rotor for its speed squared [N m s^2]."""
    slowest_radps: float = 200.0
    """Least speed of a rotor [rad/s]."""
    fastest_radps: float = 2700.0
    """Greatest speed of a rotor [rad/s]: a third more thrust than plans use at most, to turn with."""
    motor_lag_s: float = 0.02
    """Time constant with which a rotor's speed follows its command (first order) [s]."""
    mass_error: float = 0.1
    """Share by which the robot is heavier than planner, filter and tracking controller think."""
    drag_per_s: tuple[float, float, float] = (0.4, 0.4, 0.2)
    """Linear drag along the body's axes, for each kg of the mass that it is thought to have [1/s]."""
    wind_mps: float = 2.0
    """Speed of the steady wind, level and from anywhere [m/s]."""
    gust_std_mps: tuple[float, float, float] = (0.8, 0.8, 0.4)
    """Standard deviation of gusts along the wind, across it and upward [m/s]: 2.5 of them take the wind to 4 m/s."""
    gust_length_m: float = 1.0
    """Size of gusts [m]: near the ground and among obstacles about that of the obstacles."""
    camera_hz: float = 30.0
    """Frames of the camera [1/s]."""
    camera_delay: int = 1
    """Frames by which a picture is late when the filter has it; the filter knows."""
    dropped_share: float = 0.05
    """Share of pictures that never arrive."""
    gyroscope_noise: float = GYROSCOPE_NOISE
    """Of the gyroscopes: white noise [rad/s/sqrt(Hz)]."""
    gyroscope_bias_radps: float = 0.005
    """And standard deviation of their bias, which nothing estimates [rad/s]."""
    accelerometer_noise: float = 3e-3
    """Of the accelerometers: white noise [m/s^2/sqrt(Hz)]."""
    accelerometer_bias_mps2: float = 0.05
    """And standard deviation of their bias, which nothing estimates [m/s^2]."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for numbers that no world can have."""
        for name in ("control_hz", "rotor_arm_m", "motor_lag_s", "gust_length_m", "camera_hz", "thrust_coefficient"):
            if not getattr(self, name) > 0:
                raise InvalidInputError(f"{name} must be above 0, not {getattr(self, name):g}")
        if not 0 <= self.dropped_share <= 1:
            raise InvalidInputError(f"dropped_share must be from 0 to 1, not {self.dropped_share:g}")
        if not 0 <= self.slowest_radps < self.fastest_radps:
            raise InvalidInputError("the slowest speed of rotors must be at least 0 and below the fastest")
        if not self.mass_error > -1 or self.camera_delay < 0 or self.wind_mps < 0:
            raise InvalidInputError("mass_error must be above -1, camera_delay and wind_mps at least 0")

    @property
    def delay_s(self) -> float:
        """By how much a picture is late, in whole ticks of the integration [s]."""
        return round(self.camera_delay / self.camera_hz * self.control_hz) / self.control_hz

"""IMU model: noise and bias of gyroscopes and accelerometers."""

from dataclasses import asdict, dataclass, replace


@dataclass(frozen=True)
class ImuNoise:
    """Noise of an inertial measurement unit; None where it is unknown."""

    gyro: float | None = None
    """Noise of body rates [rad/s per sqrt(Hz)]."""
    accel: float | None = None
    """Noise of accelerations [m/s^2 per sqrt(Hz)]."""
    gyro_walk: float | None = None
    """How fast the gyroscope's bias strays [rad/s^2 per sqrt(Hz)]."""
    accel_walk: float | None = None
    """The same of the accelerometer's [m/s^3 per sqrt(Hz)]."""


@dataclass(frozen=True)
class ImuConfig:
    """Model of an inertial measurement unit; the defaults are those of cheap ones that fly."""

    gyro: float = 2e-3
    """Noise of body rates [rad/s per sqrt(Hz)]."""
    accel: float = 2e-2
    """Noise of accelerations [m/s^2 per sqrt(Hz)]."""
    gyro_walk: float = 2e-5
    """How fast the gyroscope's bias strays [rad/s^2 per sqrt(Hz)]."""
    accel_walk: float = 3e-3
    """The same of the accelerometer's [m/s^3 per sqrt(Hz)]."""
    gyro_bias: float = 0.05
    """Standard deviation of the gyroscope's bias at first [rad/s]."""
    accel_bias: float = 0.3
    """The same of the accelerometer's [m/s^2]."""
    gravity: float = 9.81
    """[m/s^2]"""
    gravity_std: float = 0.5
    """Standard deviation of each coordinate of gravity at first [m/s^2]: a field's z axis is only about vertical."""
    longest_gap: float = 0.1
    """Longest time without a measurement [s]."""

    def for_unit(self, noise: ImuNoise) -> "ImuConfig":
        """Return the options with the known noise of a unit."""
        return replace(self, **{name: value for name, value in asdict(noise).items() if value is not None})

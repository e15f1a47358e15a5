"""Constants of a quadrotor: mass, inertia, size and limits."""

from dataclasses import dataclass

from nerfnav.robots.body import Body
from nerfnav.robots.robot import Limit


@dataclass(frozen=True)
class QuadrotorConfig:
    """Constants of a quadrotor of the paper's size, 10 x 10 x 4 cm.

    The paper's simulated robot weighs about 1 kg, four times what flies at this size with a camera and a computer.
    """

    mass: float = 0.25
    """m [kg]."""
    inertia: tuple[float, float, float] = (2.4e-4, 2.4e-4, 4.2e-4)
    """Diagonal of J [kg m^2]: that of a solid box of this mass and size."""
    extents: tuple[float, float, float] = (0.1, 0.1, 0.04)
    """Edge lengths of the body [m], as in the paper."""
    point_counts: tuple[int, int, int] = (5, 5, 2)
    """Body points along each edge at which densities are taken: 2.5 cm apart, top and bottom."""
    gravity: float = 9.81
    """[m/s^2]"""
    max_thrust: float = 6.0
    """[N]: about two and a half times the weight, as small racers have."""
    max_tilt: float = 1.2
    """Angle between the body's z axis and the vertical [rad]."""
    max_speed: float = 3.0
    """[m/s]"""
    max_rate: float = 12.0
    """Length of the body rate [rad/s]."""
    thrust_floor: float = 0.2
    """Upward part of the thrust that motions should keep, as a share of the weight: at zero thrust and upside down
    the attitude is not defined by the waypoints."""
    angular_acceleration: float = 20.0
    """Angular acceleration that costs as much as carrying the weight [rad/s^2]: sets Gamma of the torques."""
    braking: float = 5.0
    """Deceleration for each m/s of velocity while it holds [1/s]; with steps of 0.1 s, more swings back."""
    max_braking: float = 8.0
    """Largest deceleration while it holds [m/s^2]: a tilt of about 40 degrees."""
    levelling: float = 0.8
    """Share of the attitude's error that one step removes while it holds."""
    name: str = "quadrotor"
    """Name for users."""

    @property
    def weight(self) -> float:
        """Return the weight m g [N]."""
        return self.mass * self.gravity

    @property
    def body(self) -> Body:
        """Make a box, filled with points."""
        return Body.box(self.extents, self.point_counts)

    @property
    def bounds(self) -> tuple[Limit, ...]:
        """Return the limits of the robot."""
        return (
            Limit("thrust", "N", upper=self.max_thrust),
            Limit("tilt", "rad", upper=self.max_tilt),
            Limit("speed", "m/s", upper=self.max_speed),
            Limit("body rate", "rad/s", upper=self.max_rate),
        )

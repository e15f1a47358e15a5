"""The constants of the couch."""

from dataclasses import dataclass

from nerfnav.robots.body import Body
from nerfnav.robots.robot import Limit


@dataclass(frozen=True)
class CouchConfig:
    """A couch in the paper's scale: three times as long as wide."""

    mass: float = 1.0
    """m [kg]."""
    extents: tuple[float, float, float] = (0.3, 0.1, 0.1)
    """Edge lengths of the body [m]."""
    point_counts: tuple[int, int, int] = (13, 5, 5)
    """Body points along each edge at which density is asked for: 2.5 cm apart."""
    max_speed: float = 3.0
    """[m/s]"""
    max_yaw_rate: float = 6.0
    """[rad/s]"""
    max_force: float = 15.0
    """[N]"""
    name: str = "couch"
    """What users call it."""

    @property
    def inertia(self) -> float:
        """J of a solid box [kg m^2]."""
        return self.mass * (self.extents[0] ** 2 + self.extents[1] ** 2) / 12

    @property
    def body(self) -> Body:
        """A box, filled with points."""
        return Body.box(self.extents, self.point_counts)

    @property
    def bounds(self) -> tuple[Limit, ...]:
        """What it can do at most."""
        return (
            Limit("speed", "m/s", upper=self.max_speed),
            Limit("yaw rate", "rad/s", -self.max_yaw_rate, self.max_yaw_rate),
            Limit("force", "N", upper=self.max_force),
        )

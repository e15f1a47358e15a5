"""The constants of the differential drive."""

from dataclasses import dataclass

from nerfnav.robots.body import Body
from nerfnav.robots.robot import Limit


@dataclass(frozen=True)
class DiffDriveConfig:
    """A small robot on two wheels."""

    extents: tuple[float, float, float] = (0.14, 0.12, 0.08)
    """Edge lengths of the body [m]."""
    point_counts: tuple[int, int, int] = (7, 6, 4)
    """Body points along each edge at which density is asked for: 2.5 cm apart."""
    max_speed: float = 3.0
    """Forward or reverse [m/s]."""
    max_yaw_rate: float = 8.0
    """[rad/s]"""
    max_acceleration: float = 12.0
    """[m/s^2]"""
    max_yaw_acceleration: float = 60.0
    """[rad/s^2]"""
    name: str = "diffdrive"
    """What users call it."""

    @property
    def body(self) -> Body:
        """A box, filled with points."""
        return Body.box(self.extents, self.point_counts)

    @property
    def bounds(self) -> tuple[Limit, ...]:
        """What it can do at most."""
        most = {
            ("speed", "m/s"): self.max_speed,
            ("yaw rate", "rad/s"): self.max_yaw_rate,
            ("acceleration", "m/s^2"): self.max_acceleration,
            ("yaw acceleration", "rad/s^2"): self.max_yaw_acceleration,
        }
        return tuple(Limit(*named, -value, value) for named, value in most.items())

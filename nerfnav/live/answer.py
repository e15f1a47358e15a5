"""Records of a navigator: goals in, answers and setpoints out, as plain numbers. Nothing slow is imported here.

The world is the field's frame, ENU and z-up, in metres; the body is FLU. Times are those of the vehicle's own clock.
"""

import math
from bisect import bisect_right
from dataclasses import dataclass
from enum import Enum

Vector = tuple[float, float, float]
OLDEST_S = 0.5
"""Age of a picture from which on nothing is planned from it, and no plan from it is begun [s]."""


class Order(Enum):
    """Order to a vehicle."""

    FOLLOW = "follow"
    """Follow the setpoints to the goal."""
    BRAKE = "brake"
    """Follow the setpoints, which come to rest in free space: no way to the goal is safe now."""
    HOLD = "hold"
    """Stop and stay, by your own means: no safe motion is known."""
    ARRIVED = "arrived"
    """Stay at the setpoint, which is the goal."""


@dataclass(frozen=True)
class Goal:
    """Goal state, at rest."""

    position: Vector
    """In the world [m]."""
    yaw: float = 0.0
    """Heading of the body's x axis, counter-clockwise from the world's x axis [rad]."""


@dataclass(frozen=True)
class Setpoint:
    """Motion at one time."""

    time: float
    """[s]"""
    position: Vector
    """In the world [m]."""
    velocity: Vector
    """[m/s]"""
    acceleration: Vector
    """Without gravity [m/s^2]."""
    yaw: float
    """[rad]; neighbours do not jump by a turn."""

    @property
    def half_turn(self) -> tuple[float, float]:
        """w and z of the quaternion of the yaw; its x and y are 0."""
        return math.cos(self.yaw / 2), math.sin(self.yaw / 2)


@dataclass(frozen=True)
class Guidance:
    """Setpoints to a goal, or the reason for none."""

    order: Order
    reason: str
    """Why, in one sentence."""
    setpoints: tuple[Setpoint, ...] = ()
    """In the order of their times, the first at the time of the picture or, of a plan that is less than a step old, a
    little before it; the last is at rest. None for HOLD."""
    collision_bound: float | None = None
    """Upper bound of the probability that the motion collides, as the field has it."""

    def at(self, time: float) -> Setpoint | None:
        """Return the motion at any time: accelerations are linear between setpoints, and constant beyond the ends.

        None where there are no setpoints.
        """
        if not self.setpoints:
            return None
        index = bisect_right([point.time for point in self.setpoints], time) - 1
        if not 0 <= index < len(self.setpoints) - 1:
            return self.setpoints[max(0, index)]
        here, after = self.setpoints[index : index + 2]
        t, share = time - here.time, (time - here.time) / (after.time - here.time)
        columns = list(zip(here.position, here.velocity, here.acceleration, after.acceleration, strict=True))
        x, y, z = (p + v * t + a * t**2 / 2 + (b - a) * share * t**2 / 6 for p, v, a, b in columns)
        vx, vy, vz = (v + a * t + (b - a) * share * t / 2 for _, v, a, b in columns)
        ax, ay, az = (a + (b - a) * share for *_, a, b in columns)
        return Setpoint(time, (x, y, z), (vx, vy, vz), (ax, ay, az), here.yaw + (after.yaw - here.yaw) * share)


@dataclass(frozen=True)
class CameraCheck:
    """Comparison of the given camera with the field, from the first pictures in which the vehicle was found."""

    ok: bool
    """The given camera fits."""
    given_fov_deg: float
    """Its horizontal field of view [degrees]."""
    fitted_fov_deg: float
    """The one that fits best [degrees]."""
    sentence: str
    """The result in words."""


@dataclass(frozen=True)
class Answer:
    """Pose and guidance after a picture."""

    time: float
    """When the picture was taken, and what `position` to `covariance` are of [s]."""
    status: str
    """`searching`, `found`, `followed`, `predicted`, `lost` or `found_again` (see TrackStatus); or `old`: the time of
    the picture does not follow the one before it; it was not used, so that what was answered last still holds."""
    sentence: str
    """The status in words."""
    position: Vector | None = None
    """Of the body in the world [m]; None, as all that follows, while it is not known."""
    quaternion: tuple[float, float, float, float] | None = None
    """(w, x, y, z) of R_world_body."""
    velocity: Vector | None = None
    """Of the body in the world [m/s]."""
    covariance: tuple[tuple[float, ...], ...] | None = None
    """6 x 6: position [m], then a turn [rad], both about the world's fixed axes (REP 103)."""
    guidance: Guidance | None = None
    """What to do; None where no goal was given."""
    track_ms: float = 0.0
    """Time that the pose took [ms]."""
    plan_ms: float = 0.0
    """Time that the guidance took [ms]."""
    waited_ms: float = 0.0
    """Time for which the picture lay unseen where it had arrived, and was made pixels of [ms]."""
    dropped: int = 0
    """Pictures since the last answer that were never looked at, for newer ones had come."""
    camera_check: CameraCheck | None = None
    """Comparison of the camera with the field; None until enough pictures were followed."""

    def guidance_at(self, now: float, oldest: float = OLDEST_S) -> Guidance | None:
        """Return the guidance at a time of the vehicle's clock [s], at which the answer is there: HOLD where its
        picture is older than `oldest` [s]. A vehicle that waited so long is not where the plan would have it by now."""
        age = now - self.time
        if self.guidance is None or age <= oldest:
            return self.guidance
        return Guidance(Order.HOLD, f"the answer comes {age:.2f} s after its picture: at most {oldest:g} s are safe")

    @property
    def latency_ms(self) -> float:
        """From the picture's arrival to the answer [ms]."""
        return self.waited_ms + self.track_ms + self.plan_ms

"""Motions of obstacles: functions of time, each with a bound on its speed.

A motion gives the offset of the obstacle from its position [m] at any time from 0 on [s]. It keeps the attitude.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from nerfnav.core.errors import InvalidInputError, require_not_negative, require_positive

Vector = tuple[float, float, float]
Times = Float[np.ndarray, " m"]
Offsets = Float[np.ndarray, "m 3"]

_ROUNDING = 1 + 1e-9
_TURNS = 64
"""Way points of a random walk, after which it repeats."""
_PARTS = 2048
"""Samples of a trefoil's period from which its highest speed follows."""


@runtime_checkable
class Motion(Protocol):
    """Motion of an obstacle."""

    @property
    def speed_bound(self) -> float:
        """Speed that it never exceeds [m/s]."""
        ...

    def offset(self, times: Times) -> Offsets:
        """Offsets from the obstacle's position [m] at times [s]."""
        ...


@dataclass(frozen=True)
class Still:
    """No motion: the obstacle stays at its position."""

    @property
    def speed_bound(self) -> float:
        """Zero, as it stands."""
        return 0.0

    def offset(self, times: Times) -> Offsets:
        """Zero at all times."""
        return np.zeros((len(times), 3))


STILL = Still()
"""The one motion of obstacles that stand."""


@dataclass(frozen=True)
class Held(Still):
    """No motion for the moment: a hand holds the obstacle, and moves it on.

    It counts as one that moves: planners see its place at once, and maps are not made anew until it is put down.
    """


@dataclass(frozen=True)
class ConstantVelocity:
    """Straight line at a constant velocity."""

    velocity: Vector
    """[m/s]"""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for a velocity that is not finite."""
        if not all(map(math.isfinite, self.velocity)):
            raise InvalidInputError(f"the velocity of an obstacle is finite, not {list(self.velocity)}")

    @property
    def speed_bound(self) -> float:
        """Its constant speed [m/s]."""
        return math.hypot(*self.velocity)

    def offset(self, times: Times) -> Offsets:
        """Velocity times time [m]."""
        return times[:, None] * np.array(self.velocity)


@dataclass(frozen=True)
class WayPoints:
    """Straight legs between way points at a constant speed; the last one is kept, or the first follows it."""

    points: tuple[Vector, ...]
    """Offsets from the obstacle's position [m], at least two."""
    speed: float
    """[m/s]"""
    closed: bool = False
    """The first point follows the last one, without end."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for fewer than two points, points that are not finite, and a speed not above 0."""
        require_positive(**{"the speed of a path": self.speed})
        if len(self.points) < 2 or not np.isfinite(self._corners).all():
            raise InvalidInputError(f"a path has at least 2 finite way points, not {len(self.points)}")
        if self._arrivals[-1] == 0.0:
            raise InvalidInputError("the way points of a path are all at one place: leave the motion out")

    @cached_property
    def _corners(self) -> Float[np.ndarray, "k 3"]:
        points = np.array(self.points, float).reshape(-1, 3)
        return np.concatenate([points, points[:1]]) if self.closed else points

    @cached_property
    def _arrivals(self) -> Float[np.ndarray, " k"]:
        """Time at each corner [s]."""
        return np.concatenate([[0.0], np.linalg.norm(np.diff(self._corners, axis=0), axis=1).cumsum()]) / self.speed

    @property
    def speed_bound(self) -> float:
        """Its constant speed [m/s]."""
        return self.speed

    def offset(self, times: Times) -> Offsets:
        """Place on the path [m]."""
        along = times % self._arrivals[-1] if self.closed else times
        return np.stack([np.interp(along, self._arrivals, axis) for axis in self._corners.T], axis=-1)


@dataclass(frozen=True)
class RandomWalk:
    """Straight legs at a constant speed between random points of a box, the same for each seed; it repeats after 64."""

    lower: Vector
    """Smallest offset from the obstacle's position [m]."""
    upper: Vector
    """Largest offset [m]."""
    speed: float
    """[m/s]"""
    seed: int = 0
    """Of the random points, at least 0."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for a box without a size, a speed not above 0, and a seed below 0."""
        require_positive(**{"the speed of a walk": self.speed})
        require_not_negative(**{"the seed of a walk": self.seed})
        low, high = np.array(self.lower), np.array(self.upper)
        if not (np.isfinite([low, high]).all() and (low <= high).all() and (low < high).any()):
            raise InvalidInputError(
                f"the box of a walk goes from its lower to its upper corner, not from {list(self.lower)} to "
                f"{list(self.upper)}"
            )

    @cached_property
    def _path(self) -> WayPoints:
        drawn = np.random.default_rng(self.seed).uniform(self.lower, self.upper, (_TURNS, 3))
        return WayPoints(tuple((float(x), float(y), float(z)) for x, y, z in drawn), self.speed, closed=True)

    @property
    def speed_bound(self) -> float:
        """Its constant speed [m/s]."""
        return self.speed

    def offset(self, times: Times) -> Offsets:
        """Place on the walk [m]."""
        return self._path.offset(times)


@dataclass(frozen=True)
class Trefoil:
    """Trefoil knot, as in benchmarks of planners among moving obstacles (Tordesillas and How, "MADER", T-RO 2022).

    With (sx, sy, sz) = scale, o = offset and tau = t / slower:

        x = sx / 6 (sin(tau + o) + 2 sin(2 tau + o))
        y = sy / 5 (cos(tau + o) - 2 cos(2 tau + o))
        z = -sz / 2 sin(3 tau + o)

    The phase o is not multiplied by 2 and 3, so that it is a true trefoil for o = 0 only.
    """

    scale: Vector
    """Size along x, y, z [m]."""
    phase: float
    """Phase o [rad]."""
    slower: float
    """Time in which tau grows by one [s]."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for a scale or a time that is not above 0, and a phase that is not finite."""
        require_positive(**{"the time `slower` of a trefoil": self.slower})
        for size in self.scale:
            require_positive(**{"the scale of a trefoil": size})
        if not math.isfinite(self.phase):
            raise InvalidInputError(f"the phase of a trefoil is finite, not {self.phase}")

    @property
    def speed_bound(self) -> float:
        """Highest speed over its period [m/s]: that of samples, and what it can gain between two of them."""
        step = 2 * math.pi / _PARTS
        a, b, c = (k * step * np.arange(_PARTS) + self.phase for k in (1, 2, 3))
        slope = [(np.cos(a) + 4 * np.cos(b)) / 6, (4 * np.sin(b) - np.sin(a)) / 5, -1.5 * np.cos(c)]
        speed = np.linalg.norm(np.array(self.scale) * np.stack(slope, -1), axis=-1)
        sharpest = np.linalg.norm(np.array(self.scale) * (1.5, 1.8, 4.5))
        return float((speed.max() + 0.5 * step * sharpest) / self.slower)

    def offset(self, times: Times) -> Offsets:
        """Place on the curve [m]."""
        a, b, c = (k * (times / self.slower) + self.phase for k in (1, 2, 3))
        curve = [(np.sin(a) + 2 * np.sin(b)) / 6, (np.cos(a) - 2 * np.cos(b)) / 5, -np.sin(c) / 2]
        return np.array(self.scale) * np.stack(curve, axis=-1)


def require_speed(motion: Motion, most: float) -> None:
    """Raise InvalidInputError for a motion that may exceed the stated speed `most` [m/s]."""
    if motion.speed_bound > most * _ROUNDING:
        raise InvalidInputError(
            f"the motion reaches {motion.speed_bound:.3g} m/s, more than its stated max_speed of {most:g} m/s: "
            "state that speed, or slow it down"
        )

"""Timing of a path among movers: when to be where on it, waiting and yielding included (Kant and Zucker, "Toward
efficient trajectory planning: the path-velocity decomposition", 1986).

A table says for each half step and each point of the path whether a mover covers it. The way through the table whose
moves change least, within the robot's speed and acceleration, is the timing.
"""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from nerfnav.planner.kernels.movers import time_path
from nerfnav.planner.moving.movers import Movers
from nerfnav.robots import Body

_NO_WAY = 1e29
_MOVES = 8
"""Points of the path in the robot's fastest step."""


@dataclass(frozen=True)
class PathTiming:
    """Times, speeds and room of a robot on a path."""

    time: float
    """Time of the flight at its start [s]."""
    steps: int
    """Number of time steps to its end."""
    dt: float
    """Length of a step [s]."""
    first_speed: float
    """Speed at the start [m/s]."""
    most_speed: float
    """Greatest speed [m/s]."""
    acceleration: float
    """Greatest acceleration on the path [m/s^2]."""
    margin: float
    """Distance from movers that is kept [m]."""


def time_along(
    path: Float[np.ndarray, "n 3"], movers: Movers, body: Body, timing: PathTiming
) -> Float[np.ndarray, " times"] | None:
    """Find the share of a path that is covered at each of the times; None where movers leave no way."""
    reached = np.concatenate([[0.0], np.linalg.norm(np.diff(path, axis=0), axis=1).cumsum()])
    length = float(reached[-1])
    cell = max(timing.most_speed * timing.dt / _MOVES, 1e-6)
    count = max(2, int(np.ceil(length / cell)) + 1)
    along = np.linspace(0.0, length, count)
    points = np.stack([np.interp(along, reached, axis) for axis in path.T], -1)
    times = timing.time + 0.5 * timing.dt * np.arange(2 * timing.steps + 1)
    blocked = movers.boxes(times, body).cover(points, timing.margin)
    places = np.zeros(timing.steps + 1, np.int64)
    first = round(timing.first_speed * timing.dt / cell)
    gain = math.ceil(min(timing.acceleration * timing.dt**2 / cell, _MOVES))
    if time_path(blocked, first, _MOVES, gain, places) > _NO_WAY:
        return None
    return places / (count - 1)

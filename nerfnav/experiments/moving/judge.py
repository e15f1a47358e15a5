"""Judge of a flight among moving boxes: contact by two rules, arrival, limits, and what it cost, at 100 Hz.

    boxes   the robot's box and the true boxes
    cubes   as SANDO's analysis does it: the robot a point, every obstacle a cube of 0.8 m
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from nerfnav.experiments.moving.worlds import ASIDE_M, GOAL, HALF_M, HEIGHTS, LIMITS, World
from nerfnav.experiments.study import Row
from nerfnav.obstacles import ObstacleSet
from nerfnav.planner.moving.spline import SplinePlan

RATE_HZ = 100
"""Samples a second."""
NEAR_M, SLOW_MPS = 0.5, 0.1
"""Distance from the goal and speed below which a flight has arrived."""
_TOLERANCE = 1e-3
"""Excess over a limit that is no violation."""
_MANY = 256
"""Times at which all obstacles are compared together."""


@dataclass(frozen=True)
class Flown:
    """Motion of a flight at RATE_HZ."""

    times: Float[np.ndarray, " m"]
    """[s]"""
    states: Float[np.ndarray, "4 m 3"]
    """Position, velocity, acceleration and jerk, in m and s."""

    @classmethod
    def of(cls, plan: SplinePlan) -> "Flown":
        """Fly a plan to its end, without an error."""
        times = np.arange(int(np.ceil(plan.duration * RATE_HZ)) + 1) / RATE_HZ
        return cls(times, np.stack([plan.derivative(times, order) for order in range(4)]))


def judge_flight(world: World, flown: Flown) -> Row:
    """Numbers of a flight; `success`: it arrived, touched nothing by either rule, and stayed in the corridor."""
    position, velocity, acceleration, jerk = flown.states
    there = (np.linalg.norm(position - GOAL, axis=1) < NEAR_M) & (np.linalg.norm(velocity, axis=1) < SLOW_MPS)
    end = int(np.argmax(there)) if there.any() else len(there) - 1
    until = slice(0, end + 1)
    gap = _least_gap(world.obstacles, HALF_M, flown.times[until], position[until])
    cubes = _least_gap(world.cubes, 0.0, flown.times[until], position[until])
    aside, height = np.abs(position[until, 1]).max(), position[until, 2]
    pairs = ((velocity, LIMITS.speed), (acceleration, LIMITS.acceleration), (jerk, LIMITS.jerk))
    over = np.any([(np.abs(values[until]) > limit + _TOLERANCE).any(-1) for values, limit in pairs], axis=0)
    inside = aside <= ASIDE_M and bool((height >= HEIGHTS[0]).all() and (height <= HEIGHTS[1]).all())
    steps = np.diff(position[until], axis=0)
    return {
        "success": bool(there.any()) and gap > 0 and cubes > 0 and inside,
        "arrived": bool(there.any()),
        "touched_boxes": gap <= 0,
        "touched_cubes": cubes <= 0,
        "time_s": float(flown.times[end]),
        "path_m": float(np.linalg.norm(steps, axis=1).sum()),
        "jerk_mps2": float(np.linalg.norm(jerk[until], axis=1).mean() * flown.times[end]),
        "least_distance_m": max(0.0, gap),
        "largest_y_m": float(aside),
        "violations_percent": 100 * float(over.mean()),
    }


def _least_gap(
    obstacles: ObstacleSet, half: float, times: Float[np.ndarray, " m"], path: Float[np.ndarray, "m 3"]
) -> float:
    """Least distance between a cube around the path and the obstacles' boxes [m]; 0 where faces touch or overlap."""
    least = np.inf
    for start in range(0, len(times), _MANY):
        some = slice(start, start + _MANY)
        boxes = obstacles.boxes(times[some])
        gap = np.abs(path[some, None] - boxes.centers) - (boxes.halves + half)
        least = min(least, float(np.linalg.norm(gap.clip(0.0), axis=-1).min(initial=np.inf)))
    return least

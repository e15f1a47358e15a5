"""Shortest duration: find the fewest time steps in which a robot keeps its limits, beginning with an estimate.

A path of length L takes at least T >= L / v at the limit of speed v. Easing in and out takes more; 1.4 L / v is nearly
always enough, and no more than 40 % too long. From rest to rest with least jerk, a path takes the acceleration
5.8 L / T^2 at most.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from nerfnav.core.steps import run_steps
from nerfnav.planner.steps import PlanOutcome, PlanSteps
from nerfnav.robots import Robot, limit_uses

_HOPELESS = (PlanOutcome.NO_PATH, PlanOutcome.IN_COLLISION, PlanOutcome.LIKELY_COLLISION, PlanOutcome.DIVERGED)
_AROUND, _EASING, _LEAST_JERK = 1.4, 1.4, 10 / 3**0.5
_SAMPLES = 3
"""Densities taken along each step, see CostWeights.samples_per_step."""
_MANY = 80
"""Steps from which on longer ones are taken, as far as the robot's size allows: a search takes their square."""


@dataclass(frozen=True)
class DurationConfig:
    """Settings of the search for a duration."""

    fewest: int = 6
    """First number of steps, or the fewest that the robot can plan."""
    most: int = 120
    """Largest number of steps."""
    growth: float = 1.5
    """Factor between the durations of two plans while limits are exceeded."""
    impossible: int = 0
    """Number of steps that is known to be too small."""
    exactly: int = 40
    """Number of steps up to which the fewest are found exactly."""
    nearly: float = 1.5
    """Beyond that, accepted ratio to a number of steps that is known to be too small: each trial takes long then."""


@dataclass(frozen=True)
class Timing:
    """Estimate of a duration, before anything is planned."""

    steps: int
    """Number of steps that should be enough."""
    dt: float
    """Length of a step [s]."""
    impossible: int
    """Number of steps that is too small in any case."""

    @property
    def config(self) -> DurationConfig:
        """Return the durations to try, from this estimate on."""
        most = max(DurationConfig.most, 4 * self.steps)
        return DurationConfig(fewest=self.steps, most=most, impossible=self.impossible)


def estimate_timing(robot: Robot, length: float, dt: float, longest_dt: float | None = None) -> Timing:
    """Estimate the duration of a path of a length [m] in steps of `dt` [s].

    Steps may be up to `longest_dt` long (default: see `longest_step`) where there would be very many of them.
    """
    fewest = max(DurationConfig.fewest, robot.minimum_steps)
    speed = robot.most("speed")
    if not speed:
        return Timing(fewest, dt, 0)
    least_s = length / speed
    longest_dt = longest_step(robot, speed) if longest_dt is None else longest_dt
    dt = min(max(dt, _EASING * least_s / _MANY), max(dt, longest_dt))
    enough_s = _EASING * least_s
    if robot.acceleration is not None:
        enough_s = max(enough_s, math.sqrt(_LEAST_JERK * length / robot.acceleration))
    return Timing(max(fewest, math.ceil(enough_s / dt)), dt, math.floor(least_s / dt))


def is_hurried(robot: Robot, distance: float, seconds: float) -> bool:
    """Return True if a time [s] is surely too short for a robot's limit of speed with ends a distance [m] apart: a path
    around obstacles is about 1.4 times the straight line, and easing in and out takes 1.4 times as long."""
    speed = robot.most("speed")
    return speed is not None and _AROUND * _EASING * distance > seconds * speed


def longest_step(robot: Robot, speed: float) -> float:
    """Compute the length of a step [s] in which a robot at its greatest speed [m/s] moves by its width between two
    places where densities are taken: nothing slips through between them. 0.1 s for the paper's robot."""
    return _SAMPLES * min(robot.body.extents[:2]) / speed


def find_shortest_plan(
    plan: Callable[[int], PlanSteps], robot: Robot, config: DurationConfig | None = None
) -> PlanSteps:
    """Plan with growing numbers of steps until a plan keeps the robot's limits; then find the shortest by bisection.

    `plan` makes a plan of so many steps. Yields the end of each plan that was made; the outcome is OVER_LIMITS where
    even the longest plan exceeds the limits.
    """
    config = DurationConfig() if config is None else config
    short, best = max(config.impossible, robot.minimum_steps - 1), None
    long = max(config.fewest, robot.minimum_steps, short + 1)
    tried = 0
    while best is None or not _is_short(long, short, config):
        steps = long if best is None else (short + long) // 2
        found = run_steps(plan(steps))
        keeps = found.outcome not in _HOPELESS and not any(use.violated for use in limit_uses(robot, found.motion))
        yield replace(found.as_step(), iteration=tried)
        tried += 1
        if keeps:
            best, long = found, steps
        elif best is not None:
            short = steps
        elif found.outcome is PlanOutcome.NO_PATH or long >= config.most:
            lost = found.outcome if found.outcome in _HOPELESS else PlanOutcome.OVER_LIMITS
            return replace(found, iteration=tried, outcome=lost)
        else:
            short, long = long, min(config.most, round(config.growth * long) + 1)
    return replace(best, iteration=tried)


def _is_short(long: int, short: int, config: DurationConfig) -> bool:
    """Return True if `long` steps are few enough, given that `short` steps are too few."""
    return long - short <= 1 or (long > config.exactly and long <= config.nearly * short)

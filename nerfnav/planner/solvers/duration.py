"""Shortest duration: find the fewest time steps in which a robot keeps its limits, beginning with an estimate.

No robot is sooner at its goal than its way is long and its limit of speed lets it: T >= L / v. Easing in and out
takes more; 1.4 L / v is nearly always enough, and no more than 40 % too long. From rest to rest with least jerk, a
way takes the acceleration 5.8 L / T^2 at most.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from nerfnav.planner.steps import PlanOutcome, PlanStep, last_step
from nerfnav.robots import Robot, limit_uses

_HOPELESS = (PlanOutcome.NO_PATH, PlanOutcome.IN_COLLISION, PlanOutcome.LIKELY_COLLISION, PlanOutcome.DIVERGED)
_AROUND, _EASING, _LEAST_JERK = 1.4, 1.4, 10 / 3**0.5
_SAMPLES = 3
"""Densities taken along each step, see CostWeights.samples_per_step."""
_MANY = 80
"""Steps from which on longer ones are taken, as far as the robot's size allows: a search takes their square."""


@dataclass(frozen=True)
class DurationConfig:
    """Which durations are tried."""

    fewest: int = 6
    """Number of steps to begin with, or the fewest that the robot can plan."""
    most: int = 120
    """Number of steps after which to give up."""
    growth: float = 1.5
    """By how much longer the next plan is while limits are exceeded."""
    impossible: int = 0
    """Number of steps that is known to be too few."""
    exactly: int = 40
    """Up to so many steps the fewest are found, to one."""
    nearly: float = 1.5
    """Of more steps, so many times what is known to be too few will do: each trial takes long then."""


@dataclass(frozen=True)
class Timing:
    """How long a way should take, before anything is planned."""

    steps: int
    """Steps that should be enough."""
    dt: float
    """Their length [s]."""
    impossible: int
    """Steps that are too few in any case."""

    @property
    def config(self) -> DurationConfig:
        """What to try, from here on."""
        most = max(DurationConfig.most, 4 * self.steps)
        return DurationConfig(fewest=self.steps, most=most, impossible=self.impossible)


def estimate_timing(robot: Robot, length: float, dt: float, longest_dt: float | None = None) -> Timing:
    """How long a way of a length [m] should take a robot in steps of `dt` [s].

    Steps may be up to `longest_dt` long (default: see `longest_step`) where there would be very many of them.
    """
    fewest = max(DurationConfig.fewest, robot.minimum_steps)
    speed = speed_limit(robot)
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
    """Whether a time is surely too short for a robot's limit of speed where its ends are a distance [m] apart: a way
    around is about 1.4 times the straight line, easing in and out takes 1.4 times as long."""
    speed = speed_limit(robot)
    return speed is not None and _AROUND * _EASING * distance > seconds * speed


def speed_limit(robot: Robot) -> float | None:
    """How fast it may be [m/s]; None where it may have any speed."""
    return robot.most("speed")


def longest_step(robot: Robot, speed: float) -> float:
    """Length of a step [s] in which a robot at its greatest speed [m/s] moves by its width from where densities are
    taken to where they are taken next: nothing slips through between them. 0.1 s for the paper's robot."""
    return _SAMPLES * min(robot.body.extents[:2]) / speed


def find_shortest_plan(
    plan: Callable[[int], Iterator[PlanStep]], robot: Robot, config: DurationConfig | None = None
) -> Iterator[PlanStep]:
    """Plans of growing length until one keeps the robot's limits, then the shortest such by bisection.

    `plan` makes a plan of so many steps. Yields the last step of each plan that was made, and at the end the best one
    again with its outcome: OVER_LIMITS where even the longest plan exceeds them.
    """
    config = DurationConfig() if config is None else config
    short, best = max(config.impossible, robot.minimum_steps - 1), None
    long = max(config.fewest, robot.minimum_steps, short + 1)
    tried = 0
    while best is None or not _is_short(long, short, config):
        steps = long if best is None else (short + long) // 2
        found = last_step(plan(steps))
        keeps = found.outcome not in _HOPELESS and not any(use.violated for use in limit_uses(robot, found.motion))
        yield replace(found, iteration=tried, outcome=None)
        tried += 1
        if keeps:
            best, long = found, steps
        elif best is not None:
            short = steps
        elif found.outcome is PlanOutcome.NO_PATH or long >= config.most:
            lost = found.outcome if found.outcome in _HOPELESS else PlanOutcome.OVER_LIMITS
            yield replace(found, iteration=tried, outcome=lost)
            return
        else:
            short, long = long, min(config.most, round(config.growth * long) + 1)
    yield replace(best, iteration=tried)


def _is_short(long: int, short: int, config: DurationConfig) -> bool:
    """Whether a plan of `long` steps is short enough, where one of `short` steps does not do."""
    return long - short <= 1 or (long > config.exactly and long <= config.nearly * short)

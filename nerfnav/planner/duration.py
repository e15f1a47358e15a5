"""How long a plan must take: the fewest steps in which the robot keeps its limits."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from nerfnav.planner.steps import PlanOutcome, PlanStep, last_step
from nerfnav.robots.limits import limit_uses
from nerfnav.robots.robot import Robot

_HOPELESS = (PlanOutcome.NO_PATH, PlanOutcome.IN_COLLISION, PlanOutcome.LIKELY_COLLISION, PlanOutcome.DIVERGED)


@dataclass(frozen=True)
class DurationConfig:
    """Which durations are tried."""

    fewest: int = 6
    """Number of steps to begin with, or the fewest that the robot can plan."""
    most: int = 120
    """Number of steps after which to give up."""
    growth: float = 1.5
    """By how much longer the next plan is while limits are exceeded."""


def shortest_plan(
    plan: Callable[[int], Iterator[PlanStep]], robot: Robot, config: DurationConfig | None = None
) -> Iterator[PlanStep]:
    """Plans of growing length until one keeps the robot's limits, then the shortest such by bisection.

    `plan` makes a plan of so many steps. Yields the last step of each plan that was made, and at the end the best one
    again with its outcome: OVER_LIMITS where even the longest plan exceeds them.
    """
    config = DurationConfig() if config is None else config
    short, long, best = robot.minimum_steps - 1, max(config.fewest, robot.minimum_steps), None
    tried = 0
    while best is None or long - short > 1:
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

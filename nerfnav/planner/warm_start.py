"""Planning again in flight: the rest of the last plan is carried on, unless it no longer leads to the goal.

An optimiser that only ever improves the last plan follows it wherever it goes. Before and after the search it is
therefore asked whether the plan still ends at the goal, stays clear and is not much dearer than what was left of it;
where not, ways are looked for anew from where the robot is, and the better one is flown.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import torch

from nerfnav.errors import InvalidInputError
from nerfnav.planner.duration import timing_of
from nerfnav.planner.ends import check_finite
from nerfnav.planner.fast import FastPlanConfig, improve, replan_fast
from nerfnav.planner.fused import FusedObjective
from nerfnav.planner.hot_start import hot_start
from nerfnav.planner.occupancy import OccupancyMap
from nerfnav.planner.problem import FirstGuesses, PlanProblem, map_for, way_length, ways_between
from nerfnav.planner.scales import scales_of
from nerfnav.planner.steps import PlanOutcome, PlanStep, Restart
from nerfnav.planner.terms.delay import DELAY
from nerfnav.planner.trajectory import Trajectory
from nerfnav.robots import ATTITUDE, POSITION, Motion


@dataclass(frozen=True)
class WarmStartConfig:
    """When a plan is given up and made anew."""

    drift_m: float | None = None
    """How far from the goal the last plan may end [m]; None: half the robot's width."""
    drift_rad: float = 0.2
    """How much its last heading may differ from the goal's [rad]."""
    rise: float = 2.0
    """How many times as dear as what was left of the last plan the new one may be."""
    slack: float = 0.5
    """By how much it may be dearer in any case [J]: noise pushes a robot further off than a cheap plan is worth."""


def carry_on(
    problem: PlanProblem,
    last: Motion,
    executed: int,
    config: FastPlanConfig,
    occupancy: OccupancyMap | None = None,
    warm: WarmStartConfig | None = None,
) -> Iterator[PlanStep]:
    """Plan from `problem.start` with the rest of `last`, of which `executed` steps are done, as hot start.

    Yields as `plan_fast` does. Where the plan had to be made anew, steps say why in `restart`. Start and goal are not
    checked against the field: a robot must get away from wherever it finds itself. Raises InvalidInputError for a
    start that is no number.
    """
    warm = WarmStartConfig() if warm is None else warm
    check_finite("start", problem.start)
    if len(last.actions) - executed < problem.steps:
        problem = replace(problem, overdue=True, terms=(*problem.terms, DELAY))
    moved, turned = _goal_left(problem, last, warm)
    reason, kept = Restart.GOAL_MOVED if moved or turned else None, None
    trajectory = None if moved else _rest(problem, last, executed)
    if trajectory is None:
        reason = reason or Restart.UNUSABLE
    else:
        expected = _cost_left(problem, last, executed, config)
        for step in replan_fast(problem, trajectory, config):
            if kept is not None:
                yield kept
            kept = step
        assert kept is not None, "a planner yields at least one step"
        reason = _fault(kept, expected, warm) or reason
        if reason is None:
            yield kept
            return
        yield replace(kept, outcome=None)
    yield from _anew(replace(problem, keeps_headings=False), kept, reason, config, occupancy)


def _anew(
    problem: PlanProblem,
    kept: PlanStep | None,
    reason: Restart,
    config: FastPlanConfig,
    occupancy: OccupancyMap | None,
) -> Iterator[PlanStep]:
    """Ways from where the robot is, as long as they take, then the better of the best of them and `kept`."""
    problem, guesses = _ways(problem, config, map_for(problem, occupancy or config.occupancy))
    count, best = 0 if kept is None else kept.iteration + 1, kept
    if guesses.leads or kept is None:
        for step in improve(problem, guesses.trajectories, config):
            if step.outcome is None:
                yield replace(step, iteration=count, restart=reason)
                count += 1
            elif best is None or not step.cost.total >= best.cost.total:
                best = step if guesses.leads else replace(step, outcome=PlanOutcome.NO_PATH)
    assert best is not None, "without a plan to keep, another one was made"
    yield replace(best, iteration=count, restart=reason)


def _ways(
    problem: PlanProblem, config: FastPlanConfig, occupancy: OccupancyMap
) -> tuple[PlanProblem, FirstGuesses]:
    """Ways from where the robot is, and the problem with the time that the first takes where that is more."""
    occupancy = occupancy.remembering()
    length = way_length(problem, occupancy, config.ways)
    steps = timing_of(problem.robot, length, problem.dt, problem.dt).steps
    problem = replace(problem, steps=max(problem.steps, steps))
    return problem, ways_between(problem, config.initial, occupancy, config.ways)


def _goal_left(problem: PlanProblem, last: Motion, warm: WarmStartConfig) -> tuple[bool, bool]:
    """Whether the goal is elsewhere than the last plan ends, and whether its heading is another one: with that the rest
    of the last plan may still be better than any way that is found anew."""
    apart = last.states[-1].local(problem.goal)
    drift = scales_of(problem.field, problem.robot.body).drift if warm.drift_m is None else warm.drift_m
    return bool(apart[POSITION].norm() > drift), bool(apart[ATTITUDE].norm() > warm.drift_rad)


def _rest(problem: PlanProblem, last: Motion, executed: int) -> Trajectory | None:
    """What is left of the last plan; None where it cannot be carried on."""
    try:
        trajectory = hot_start(
            last, problem.start, problem.goal, problem.robot, executed=executed, steps=problem.steps
        )
    except InvalidInputError:  # the horizon is too short for what is left
        return None
    return trajectory if torch.isfinite(trajectory.free).all() else None


def _cost_left(problem: PlanProblem, last: Motion, executed: int, config: FastPlanConfig) -> float:
    """J of what is left of the last plan, for as many steps as there will be."""
    rest = last.left_after(executed)
    left = rest.actions.shape[-2]
    if left == 0:
        return 0.0
    flat = problem.robot.flat_map(rest.states[0], rest.states[-1], left, rest.dt)
    fused = FusedObjective.of(problem.context(config.weights), problem.terms, flat)
    if fused is not None:
        total = fused.of_motion(rest).total
    else:
        with torch.no_grad():
            total = problem.cost(rest, config.weights).total.item()
    return total * max(1.0, problem.steps / left)


def _fault(found: PlanStep, expected: float, warm: WarmStartConfig) -> Restart | None:
    """Why the plan that was carried on will not do."""
    if found.outcome is PlanOutcome.DIVERGED:
        return Restart.UNUSABLE
    if found.outcome is PlanOutcome.IN_COLLISION:
        return Restart.IN_COLLISION
    return Restart.COST_ROSE if found.cost.total > warm.rise * expected + warm.slack else None

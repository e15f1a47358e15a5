"""Warm start: begin an optimisation with the last plan, shifted in time or moved to new ends.

- `shift_warm_start`: the rest of a plan whose first actions were flown, as seen from the robot's state;
- `replan_from`: plan again in flight from that rest, unless it no longer leads to the goal;
- `move_ends`: the last plan between new ends;
- `replan_moved_ends`: plan again from that, many times a second.

An optimiser that only ever improves the last plan follows it wherever it goes. `replan_from` therefore checks before
and after its search that the plan still ends at the goal, stays clear, keeps the robot's limits and costs not much more
than what was left of it. Otherwise it searches paths anew from the robot's state, and the better plan is flown.
"""

import math
from dataclasses import dataclass, replace

import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import so3
from nerfnav.planner.objective.objective import FusedObjective
from nerfnav.planner.objective.problem import (
    FirstGuesses,
    PlanProblem,
    map_for,
    path_length,
    paths_between,
    time_guess,
)
from nerfnav.planner.solvers.duration import estimate_timing
from nerfnav.planner.solvers.fast import (
    FIRMER,
    FastPlanConfig,
    count_on,
    improve,
    improve_or_wait,
    plan_fast,
    replan_fast,
)
from nerfnav.planner.space.ends import check_ends, check_finite
from nerfnav.planner.space.occupancy import OccupancyMap
from nerfnav.planner.space.scales import scales_of
from nerfnav.planner.steps import FLYABLE, PlanOutcome, PlanResult, PlanSteps, Restart
from nerfnav.planner.terms.delay import DELAY
from nerfnav.planner.terms.term import evaluate
from nerfnav.planner.trajectory import Route, Trajectory
from nerfnav.robots import ATTITUDE, POSITION, Motion, RigidState, Robot, limit_uses, unwrap_angles

_SLOWER = 1.15
"""Factor between the durations in which a path may be followed sooner."""
_BEYOND = 0.05
"""Share of a limit, or of the start's value if that is larger, by which the rest of a plan may exceed it: noise takes a
robot that far."""
_RECOVERY_S = 1.2
"""Time over which a robot returns to its plan [s]: sooner takes sharp turns, later drifts into what is near."""


def shift_warm_start(
    motion: Motion, start: RigidState, goal: RigidState, robot: Robot, *, executed: int = 1, steps: int | None = None
) -> Trajectory:
    """Shift a motion in time: its rest after `executed` steps, from a new start.

    Left alone, the planned actions would carry the new start (a filter's mean) away from the plan. The waypoints
    follow where they would carry it, fade back to the plan, and end at the goal. `steps` is the new horizon: by
    default what is left, at least the fewest that the robot can plan; a longer horizon waits at the goal.
    Raises InvalidInputError for a horizon shorter than what is left, in which the goal would come too soon.
    """
    left = motion.actions.shape[-2] - executed
    steps = max(left, robot.minimum_steps) if steps is None else steps
    if not 0 <= left <= steps:
        raise InvalidInputError(f"a horizon of {steps} steps does not hold the {left} that are left of the motion")
    planned = motion.states[executed:]
    back = (torch.arange(left + 1) * motion.dt / min(_RECOVERY_S, max(left, 1) * motion.dt)).clamp_max(1)
    away = 1 - back.square() * (3 - 2 * back)
    astray = int((away > 0).sum())  # steps from which nothing of the drift is left need no rolling out
    rolled = robot.roll_out_positions(start, motion.actions[executed:][: astray - 1], motion.dt)
    positions = planned.position.clone()
    positions[:astray] += away[:astray, None] * (rolled - positions[:astray])
    index = torch.arange(steps + 1).clamp_max(left)
    yaws = unwrap_angles(so3.yaw_of(planned.rotation))[index]
    turn = so3.yaw_of(goal.rotation @ planned.rotation[-1].mT)  # by which the goal has turned since
    yaws = yaws + turn * torch.arange(steps + 1) / max(steps, 1)
    waypoints = torch.cat([positions[index], yaws[:, None]], -1)
    return Trajectory(robot.encode(waypoints, start, goal, motion.dt), Route(start, goal, steps, motion.dt))


@dataclass(frozen=True)
class WarmStartConfig:
    """Limits beyond which a plan is given up and made anew."""

    drift_rad: float = 0.2
    """Largest difference between its last heading and the goal's [rad]."""
    rise: float = 2.0
    """Largest cost of the new plan, as a multiple of that of the rest of the last one."""
    sooner: float = 1.4
    """Ratio of the steps of a plan that waits for movers to those in which its path can be followed by now, from which
    on it is tried in these."""
    better_by: float = 0.05
    """Share by which that must cost less, too."""
    slack: float = 0.5
    """Increase of the cost that is accepted in any case [J]: noise pushes a robot further off than a cheap plan is
    worth."""


def replan_from(
    problem: PlanProblem,
    last: Motion,
    executed: int,
    config: FastPlanConfig,
    occupancy: OccupancyMap | None = None,
    warm: WarmStartConfig | None = None,
) -> PlanSteps:
    """Plan from `problem.start` with the rest of `last`, of which `executed` steps are done, as warm start.

    Where the plan had to be made anew, steps and result give the reason in `restart`. Start and goal are not checked
    against the field: a robot must get away from wherever it finds itself. Raises InvalidInputError for a start that
    is not finite.
    """
    warm = WarmStartConfig() if warm is None else warm
    check_finite("start", problem.start)
    if len(last.actions) - executed < problem.steps:
        problem = replace(problem, overdue=True, terms=(*problem.terms, DELAY))
    moved, turned = _goal_left(problem, last, warm)
    if not moved and (sooner := _sooner_guess(problem, last, executed, warm)) is not None:
        quicker = replace(problem, steps=sooner.steps)
        found = yield from count_on(replan_fast(quicker, sooner, config), 0, Restart.SOONER)
        better = found.cost.total < (1 - warm.better_by) * _cost_left(problem, last, executed, config)
        if better and found.outcome in FLYABLE:
            return found
    reason, kept = Restart.GOAL_MOVED if moved or turned else None, None
    trajectory = None if moved else _rest(problem, last, executed)
    if trajectory is None:
        reason = reason or Restart.UNUSABLE
    else:
        expected = _cost_left(problem, last, executed, config)
        kept = yield from replan_fast(problem, trajectory, config)
        reason = _fault(problem.robot, kept, expected, warm) or reason
        if reason is None:
            return kept
        yield kept.as_step()
    return (yield from _plan_anew(replace(problem, keeps_headings=False), kept, reason, config, occupancy))


def _sooner_guess(problem: PlanProblem, last: Motion, executed: int, warm: WarmStartConfig) -> Trajectory | None:
    """Follow the rest of a plan that waits for movers in less time; None where that would not be much sooner."""
    if problem.movers is None:
        return None
    path = torch.cat([problem.start.position[None], last.states.position[executed + 1 :]])
    length = path.diff(dim=0).norm(dim=-1).sum().item()
    steps = estimate_timing(problem.robot, length, problem.dt, problem.dt).steps
    while steps * warm.sooner < problem.steps:
        guess = time_guess(replace(problem, steps=steps), path)
        if guess is not None:
            return guess
        steps = math.ceil(_SLOWER * steps)
    return None


def _plan_anew(
    problem: PlanProblem,
    kept: PlanResult | None,
    reason: Restart,
    config: FastPlanConfig,
    occupancy: OccupancyMap | None,
) -> PlanSteps:
    """Plan along new paths from the robot's state, as long as they take; return the better of that and `kept`."""
    known = map_for(problem, occupancy or config.occupancy).remembering()
    problem, guesses = _new_guesses(problem, config, known)
    count = 0 if kept is None else kept.iteration + 1
    if kept is not None and not guesses.leads:
        return replace(kept, iteration=count, restart=reason)
    found = yield from count_on(improve_or_wait(problem, guesses, config, known), count, reason)
    if kept is None or _is_better(found, kept, reason):
        return found if guesses.leads else replace(found, outcome=PlanOutcome.NO_PATH)
    return replace(kept, iteration=found.iteration, restart=reason)


def _is_better(found: PlanResult, kept: PlanResult, reason: Restart) -> bool:
    """Compare a new plan with the kept one: one over the limits gives way to one that keeps them; else J decides."""
    if reason is Restart.UNUSABLE and kept.outcome is PlanOutcome.OVER_LIMITS:
        return found.outcome in FLYABLE
    return not found.cost.total >= kept.cost.total


def _new_guesses(
    problem: PlanProblem, config: FastPlanConfig, occupancy: OccupancyMap
) -> tuple[PlanProblem, FirstGuesses]:
    """Search paths from the robot's state; the problem gets the time that the best one takes where that is more."""
    length = path_length(problem, occupancy, config.ways)
    steps = estimate_timing(problem.robot, length, problem.dt, problem.dt).steps
    problem = replace(problem, steps=max(problem.steps, steps))
    return problem, paths_between(problem, config.initial, occupancy, config.ways)


def _goal_left(problem: PlanProblem, last: Motion, warm: WarmStartConfig) -> tuple[bool, bool]:
    """Compare the goal with the end of the last plan: true if it is elsewhere, and if its heading is another one; with
    that the rest of the last plan may still be better than any new path."""
    apart = last.states[-1].local(problem.goal)
    drift = scales_of(problem.field, problem.robot.body).drift
    return bool(apart[POSITION].norm() > drift), bool(apart[ATTITUDE].norm() > warm.drift_rad)


def _rest(problem: PlanProblem, last: Motion, executed: int) -> Trajectory | None:
    """Shift the last plan; None where it cannot be continued."""
    try:
        trajectory = shift_warm_start(
            last, problem.start, problem.goal, problem.robot, executed=executed, steps=problem.steps
        )
    except InvalidInputError:  # the horizon is too short for what is left
        return None
    return trajectory if torch.isfinite(trajectory.free).all() else None


@torch.no_grad()
def _cost_left(problem: PlanProblem, last: Motion, executed: int, config: FastPlanConfig) -> float:
    """Compute J of the rest of the last plan, for as many steps as there will be."""
    rest = last.left_after(executed)
    left = rest.actions.shape[-2]
    if left == 0:
        return 0.0
    flat = problem.robot.flat_map(rest.states[0], rest.states[-1], left, rest.dt)
    context = problem.context(config.weights)
    fused = FusedObjective.of(context, problem.counted, flat)
    total = evaluate(problem.counted, context, rest).total.item() if fused is None else fused.of_motion(rest).total
    return total * max(1.0, problem.steps / left)


def _fault(robot: Robot, found: PlanResult, expected: float, warm: WarmStartConfig) -> Restart | None:
    """Return the reason to give up a plan that continues the last one; None for a good plan."""
    over = found.outcome is PlanOutcome.OVER_LIMITS and _leaves_limits(robot, found.motion)
    if over or found.outcome is PlanOutcome.DIVERGED:
        return Restart.UNUSABLE
    if found.outcome is PlanOutcome.IN_COLLISION:
        return Restart.IN_COLLISION
    return Restart.COST_ROSE if found.cost.total > warm.rise * expected + warm.slack else None


def _leaves_limits(robot: Robot, motion: Motion) -> bool:
    """Return True if a motion goes beyond the robot's limits, and further than its start, which no plan can change."""
    demands = robot.demands(motion)
    for use in limit_uses(robot, motion):
        values = demands[use.name]
        if len(values) > len(motion.actions):  # of the states, whose first one is the start
            start = values[0].item()
            lower = None if use.lower is None else min(use.lower, start)
            upper = None if use.upper is None else max(use.upper, start)
            use = replace(use, lower=lower, upper=upper)
        if use.exceeds(_BEYOND):
            return True
    return False


_LOST = (PlanOutcome.IN_COLLISION, PlanOutcome.LIKELY_COLLISION, PlanOutcome.DIVERGED)
"""Outcomes after which paths are searched anew."""


_DRAGGED = 12
"""Most iterations with which a plan between moved ends is improved; the next one goes on from there."""


def move_ends(motion: Motion, problem: PlanProblem) -> Trajectory:
    """Move a motion's waypoints between the ends of `problem`, each by its share of what the ends have moved.

        p_k + (1 - s_k) (p'_0 - p_0) + s_k (p'_n - p_n),    s_k = x^2 (3 - 2 x),  x = k / n

    The same of the yaw. Raises InvalidInputError for ends that the robot cannot have.
    """
    start, goal, states = problem.start, problem.goal, motion.states
    problem.robot.check_ends(start, goal)
    waypoints = torch.cat([states.position, unwrap_angles(so3.yaw_of(states.rotation))[:, None]], -1)
    ends = torch.stack([torch.cat([end.position, so3.yaw_of(end.rotation)[None]]) for end in (start, goal)])
    moved = ends - waypoints[[0, -1]]
    moved[:, 3] = torch.remainder(moved[:, 3] + torch.pi, 2 * torch.pi) - torch.pi
    share = torch.linspace(0, 1, len(waypoints))[:, None]
    share = share.square() * (3 - 2 * share)
    waypoints = waypoints + (1 - share) * moved[0] + share * moved[1]
    return problem.trajectory_through(waypoints)


def replan_moved_ends(
    problem: PlanProblem,
    last: Motion,
    config: FastPlanConfig | None = None,
    occupancy: OccupancyMap | None = None,
) -> PlanSteps:
    """Plan with `last`, a plan of as many steps between ends that were near, as warm start.

    Where that leads through something dense, paths are searched anew. Raises what `plan_fast` raises for ends that
    cannot be planned between.
    """
    config, count = FastPlanConfig() if config is None else config, 0
    occupancy = map_for(problem, occupancy or config.occupancy)
    check_ends(problem.field, problem.robot.body, problem.start, problem.goal, occupancy)
    moved = move_ends(last, problem) if last.actions.shape[-2] == problem.steps else None
    if moved is not None and torch.isfinite(moved.free).all():
        newton = replace(config.newton, iterations=_DRAGGED)
        scout = replace(config.scout, iterations=config.scout.heat, finalists=1)
        found = yield from improve(problem, (moved,), replace(config, newton=newton, scout=scout), FIRMER[-1:])
        if found.outcome not in _LOST:
            return found
        yield found.as_step()
        count = found.iteration + 1
    return (yield from count_on(plan_fast(problem, config, occupancy), count))

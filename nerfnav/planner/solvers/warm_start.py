"""Warm start: begin an optimisation with the last plan, shifted in time, drawn back to the robot, or moved to new ends.

- `shift_warm_start`: the rest of a plan whose first actions were flown, as seen from where the robot turned out to be;
- `replan_from`: plan again in flight from that rest, unless it no longer leads to the goal;
- `replan_moved_ends`: move a plan along with its ends and improve it a little, many times a second.

An optimiser that only ever improves the last plan follows it wherever it goes. Before and after the search of
`replan_from` it is therefore asked whether the plan still ends at the goal, stays clear and is not much costlier than
what was left of it; where not, paths are searched anew from where the robot is, and the better one is flown.
"""


from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import so3
from nerfnav.planner.objective.objective import FusedObjective
from nerfnav.planner.objective.problem import FirstGuesses, PlanProblem, map_for, path_length, paths_between
from nerfnav.planner.solvers.duration import estimate_timing
from nerfnav.planner.solvers.fast import FastPlanConfig, improve, plan_fast, replan_fast
from nerfnav.planner.space.ends import check_ends, check_finite
from nerfnav.planner.space.occupancy import OccupancyMap
from nerfnav.planner.space.scales import scales_of
from nerfnav.planner.steps import PlanOutcome, PlanStep, Restart
from nerfnav.planner.terms.delay import DELAY
from nerfnav.planner.trajectory import Route, Trajectory
from nerfnav.robots import ATTITUDE, POSITION, Motion, RigidState, Robot, unwrap_angles

_RECOVERY_S = 1.2
"""Time over which a robot returns to its plan [s]: sooner takes sharp turns, later drifts into what is near."""


def shift_warm_start(
    motion: Motion, start: RigidState, goal: RigidState, robot: Robot, *, executed: int = 1, steps: int | None = None
) -> Trajectory:
    """The rest of a motion, as seen from a new start.

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
    """When a plan is given up and made anew."""

    drift_m: float | None = None
    """How far from the goal the last plan may end [m]; None: half the robot's width."""
    drift_rad: float = 0.2
    """How much its last heading may differ from the goal's [rad]."""
    rise: float = 2.0
    """How many times as dear as what was left of the last plan the new one may be."""
    slack: float = 0.5
    """By how much it may be dearer in any case [J]: noise pushes a robot further off than a cheap plan is worth."""


def replan_from(
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
    length = path_length(problem, occupancy, config.ways)
    steps = estimate_timing(problem.robot, length, problem.dt, problem.dt).steps
    problem = replace(problem, steps=max(problem.steps, steps))
    return problem, paths_between(problem, config.initial, occupancy, config.ways)


def _goal_left(problem: PlanProblem, last: Motion, warm: WarmStartConfig) -> tuple[bool, bool]:
    """Whether the goal is elsewhere than the last plan ends, and whether its heading is another one: with that the rest
    of the last plan may still be better than any way that is found anew."""
    apart = last.states[-1].local(problem.goal)
    drift = scales_of(problem.field, problem.robot.body).drift if warm.drift_m is None else warm.drift_m
    return bool(apart[POSITION].norm() > drift), bool(apart[ATTITUDE].norm() > warm.drift_rad)


def _rest(problem: PlanProblem, last: Motion, executed: int) -> Trajectory | None:
    """What is left of the last plan; None where it cannot be carried on."""
    try:
        trajectory = shift_warm_start(
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


_LOST = (PlanOutcome.IN_COLLISION, PlanOutcome.LIKELY_COLLISION, PlanOutcome.DIVERGED)
"""Outcomes after which ways are looked for anew."""


@dataclass(frozen=True)
class MovedEndsConfig:
    """How a plan follows its ends."""

    plan: FastPlanConfig = field(default_factory=FastPlanConfig)
    """How plans are made from scratch, and what they weigh."""
    iterations: int = 12
    """Most iterations with which a plan that was carried along is improved; the next one goes on from there."""

    @property
    def improving(self) -> FastPlanConfig:
        """The same search, cut short."""
        newton = replace(self.plan.newton, iterations=self.iterations)
        return replace(self.plan, newton=newton, scout=replace(self.plan.scout, iterations=self.plan.scout.heat))


def move_ends(motion: Motion, problem: PlanProblem) -> Trajectory:
    """A motion's waypoints between the ends of `problem`, each moved by its share of what the ends have moved.

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
    carried = waypoints + (1 - share) * moved[0] + share * moved[1]
    return Trajectory(problem.robot.encode(carried, start, goal, problem.dt), problem.route)


def replan_moved_ends(
    problem: PlanProblem,
    last: Motion,
    config: MovedEndsConfig | None = None,
    occupancy: OccupancyMap | None = None,
) -> Iterator[PlanStep]:
    """Plan with `last`, a plan of as many steps between ends that were near, as warm start; yields as `plan_fast` does.

    Where that leads through something dense, ways are looked for anew. Raises what `plan_fast` raises for ends that
    cannot be planned between.
    """
    config = MovedEndsConfig() if config is None else config
    known = map_for(problem, occupancy or config.plan.occupancy)
    check_ends(problem.field, problem.robot.body, problem.start, problem.goal, known)
    carried = move_ends(last, problem) if last.actions.shape[-2] == problem.steps else None
    count = 0
    if carried is not None and torch.isfinite(carried.free).all():
        for step in improve(problem, (carried,), config.improving):
            count = step.iteration + 1
            if step.outcome in _LOST:
                yield replace(step, outcome=None)
                break
            yield step
            if step.outcome is not None:
                return
    for step in plan_fast(problem, config.plan, known):
        yield replace(step, iteration=count + step.iteration)

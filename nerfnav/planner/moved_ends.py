"""Warm start for ends that move: a plan is carried along with its ends and improved a little, many times a second."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import torch

from nerfnav.geometry import so3
from nerfnav.planner.ends import check_ends
from nerfnav.planner.fast import FastPlanConfig, improve, plan_fast
from nerfnav.planner.occupancy import OccupancyMap
from nerfnav.planner.problem import PlanProblem, map_for
from nerfnav.planner.steps import PlanOutcome, PlanStep
from nerfnav.planner.trajectory import Trajectory
from nerfnav.robots import Motion, unwrapped

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


def with_ends(motion: Motion, problem: PlanProblem) -> Trajectory:
    """A motion's waypoints between the ends of `problem`, each moved by its share of what the ends have moved.

        p_k + (1 - s_k) (p'_0 - p_0) + s_k (p'_n - p_n),    s_k = x^2 (3 - 2 x),  x = k / n

    The same of the yaw. Raises InvalidInputError for ends that the robot cannot have.
    """
    start, goal, states = problem.start, problem.goal, motion.states
    problem.robot.check_ends(start, goal)
    waypoints = torch.cat([states.position, unwrapped(so3.yaw_of(states.rotation))[:, None]], -1)
    ends = torch.stack([torch.cat([end.position, so3.yaw_of(end.rotation)[None]]) for end in (start, goal)])
    moved = ends - waypoints[[0, -1]]
    moved[:, 3] = torch.remainder(moved[:, 3] + torch.pi, 2 * torch.pi) - torch.pi
    share = torch.linspace(0, 1, len(waypoints))[:, None]
    share = share.square() * (3 - 2 * share)
    carried = waypoints + (1 - share) * moved[0] + share * moved[1]
    return Trajectory(problem.robot.encode(carried, start, goal, problem.dt), problem.route)


def follow_ends(
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
    carried = with_ends(last, problem) if last.actions.shape[-2] == problem.steps else None
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

"""Does the collision loss mean collision? Loss against true overlap, over the iterations of plans from bad starts.

Each plan begins on a way that leads around what is in between, but drawn towards the straight line until the body
reaches into something, and is then improved by the paper's Adam, which is slow enough to be watched. At every watched
iteration

    loss      sum over steps and body points of rho(x_b) s(b), paper Eq. 1, in the field
    overlap   volume that the body shares with the true solids, integrated along the way [m^3 m]

Spearman's rank correlation is taken over the iterations from the start to the first one that touches nothing (all of
them where none does): afterwards the overlap is 0 throughout, and ranks among equals mean nothing. The correlation
over all watched iterations, ties included, is told beside it.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache, partial

import torch

from nerfnav.experiments.arena import Arena
from nerfnav.experiments.correlation_results import picture, summary_of
from nerfnav.experiments.study import ExperimentStep, Results, Row, Study, run_trials
from nerfnav.planner import (
    CostWeights,
    OccupancyMap,
    PlanConfig,
    PlanProblem,
    Route,
    Trajectory,
    collision_per_step,
    replan,
)
from nerfnav.planner.space.astar import find_path, smooth_path, waypoints_along
from nerfnav.robots import Motion, Quadrotor, QuadrotorConfig
from nerfnav.world import Task, judge

_ROBOT = Quadrotor(QuadrotorConfig(point_counts=(7, 7, 3)))
"""Body points 2 cm apart: in a coarser body a thin bar may lie between the points, where no loss sees the overlap."""
_SAMPLES = 6
"""Densities taken along each body point's way through a step, about 2 cm apart."""
_STEPS, _DT = 20, 0.1
"""Length of a flight: 2 s, as in the paper."""
_SHARES = 20
"""Steps from the way around to the straight line."""


@dataclass(frozen=True)
class Watch:
    """One trial: a plan, and when to look at it."""

    task: Task
    """From where to where."""
    iterations: int = 300
    """Steps of Adam."""
    every: int = 4
    """Steps from one look to the next."""
    depth: float = 0.1
    """How deeply the start reaches into something at least, as a share of the body's volume."""


def run(study: Study) -> Iterator[ExperimentStep]:
    """Watch a plan of every task, but for those whose straight line is free, or that have no way at all."""
    watches = [Watch(task) for task in study.first(study.tasks, "tasks")]
    tables = yield from run_trials(study, "watching plans", watch, watches)
    rows = tuple(row for table in tables for row in table)
    yield Results(summary_of(rows), rows, {"correlation": partial(picture, rows)})


def watch(arena: Arena, item: Watch) -> list[Row]:
    """Loss and overlap of every watched iteration; none where there is no bad start."""
    start = _bad_start(arena, item)
    if start is None:
        return []
    problem = PlanProblem(arena.field, _ROBOT, start.start, start.route.goal, start.steps, start.route.dt)
    config = PlanConfig(iterations=item.iterations, weights=CostWeights(samples_per_step=_SAMPLES, margin=0.0))
    rows = []
    for step in replan(problem, start, config):
        if step.iteration % item.every == 0 or step.outcome is not None:
            loss = collision_per_step(arena.field, step.motion, _ROBOT.body, _SAMPLES).sum().item()
            overlap = overlap_along(arena, step.motion)
            rows.append({"task": item.task.name, "iteration": step.iteration, "loss": loss, "overlap_m4": overlap})
    return rows


def overlap_along(arena: Arena, motion: Motion) -> float:
    """Volume shared with the solids, integrated along the way [m^3 m]."""
    report = judge(arena.scene, _ROBOT.body, motion.states)
    way = report.poses.position.diff(dim=0).norm(dim=-1).double()
    return ((report.overlap_m3[1:] + report.overlap_m3[:-1]) / 2 * way).sum().item()


def _bad_start(arena: Arena, item: Watch) -> Trajectory | None:
    """The way that A* finds, drawn towards the straight line as little as reaches into something; None if nothing."""
    start, goal = item.task.start_state, item.task.goal_state
    path = find_path(_map_of(arena), start.position, goal.position)
    if path is None:
        return None
    straight = torch.stack([start.position, goal.position])
    around, through = (waypoints_along(way, start, goal, _STEPS) for way in (smooth_path(path), straight))
    x, y, z = _ROBOT.body.extents
    for share in torch.linspace(0, 1, _SHARES + 1):
        free = _ROBOT.encode(around + share * (through - around), start, goal, _DT)
        trajectory = Trajectory(free, Route(start, goal, _STEPS, _DT))
        report = judge(arena.scene, _ROBOT.body, trajectory.motion(_ROBOT).states)
        if report.max_overlap_m3 >= item.depth * x * y * z:
            return trajectory
    return None


@lru_cache(maxsize=2)
def _map_of(arena: Arena) -> OccupancyMap:
    return OccupancyMap.of(arena.field, _ROBOT.body)

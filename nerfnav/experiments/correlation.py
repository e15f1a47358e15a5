"""Correlation of the collision loss with true overlap, over the iterations of plans from bad starts.

Each plan starts from a collision-free path, blended with the straight line until the body overlaps with something, and
is then improved by the paper's Adam, which is slow enough to be observed. At every observed iteration

    loss      sum over steps and body points of rho(x_b) s(b), paper Eq. 1, in the field
    overlap   volume that the body shares with the true solids, integrated along the path [m^3 m]

Spearman's rank correlation is taken over the iterations from the start to the first one that touches nothing (all of
them where none does): afterwards the overlap is 0 throughout, and ranks among equals mean nothing. The correlation
over all observed iterations, ties included, is reported beside it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import scipy
import torch

from nerfnav.core.steps import yield_result
from nerfnav.experiments.arena import Arena, per_arena
from nerfnav.experiments.figures import COLORS, Figure, panels
from nerfnav.experiments.study import ExperimentSteps, Results, Row, Study, run_trials
from nerfnav.planner import (
    CostWeights,
    OccupancyMap,
    PlanConfig,
    PlanProblem,
    PlanResult,
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
"""Densities taken along each body point's path through a step, about 2 cm apart."""
_STEPS, _DT = 20, 0.1
"""Length of a flight: 2 s, as in the paper."""
_SHARES = 20
"""Steps of the blend from the detour to the straight line."""


@dataclass(frozen=True)
class PlanTrial:
    """Trial of the experiment: a plan, and the interval of its observations."""

    task: Task
    """From where to where."""
    iterations: int = 300
    """Steps of Adam."""
    every: int = 4
    """Iterations from one observation to the next."""
    depth: float = 0.1
    """Least overlap of the start, as a share of the body's volume."""


def run(study: Study) -> ExperimentSteps:
    """Observe a plan of every task, but for those whose straight line is free, or that have no path at all."""
    trials = [PlanTrial(task) for task in study.first(study.tasks, "tasks")]
    tables = yield from run_trials(study, "watching plans", observe_plan, trials)
    rows = tuple(row for table in tables for row in table)
    return Results(summarize(rows), rows, {"correlation": partial(draw_figure, rows)}, sample=measures_of(rows))


def observe_plan(arena: Arena, item: PlanTrial) -> list[Row]:
    """Loss and overlap of every watched iteration; none where there is no bad start."""
    start = _bad_start(arena, item)
    if start is None:
        return []
    problem = PlanProblem(arena.field, _ROBOT, start.start, start.route.goal, start.steps, start.route.dt)
    config = PlanConfig(iterations=item.iterations, weights=CostWeights(samples_per_step=_SAMPLES, margin=0.0))
    return [
        {
            "task": item.task.name,
            "iteration": step.iteration,
            "loss": collision_per_step(arena.field, step.motion, _ROBOT.body, _SAMPLES).sum().item(),
            "overlap_m4": overlap_along(arena, step.motion),
        }
        for step in yield_result(replan(problem, start, config))
        if step.iteration % item.every == 0 or isinstance(step, PlanResult)
    ]


def overlap_along(arena: Arena, motion: Motion) -> float:
    """Volume shared with the solids, integrated along the path [m^3 m]."""
    report = judge(arena.scene, _ROBOT.body, motion.states)
    lengths = report.poses.position.diff(dim=0).norm(dim=-1).double()
    return ((report.overlap_m3[1:] + report.overlap_m3[:-1]) / 2 * lengths).sum().item()


def _bad_start(arena: Arena, item: PlanTrial) -> Trajectory | None:
    """Path of A*, blended with the straight line as little as makes it overlap; None if nothing does."""
    start, goal = item.task.start_state, item.task.goal_state
    path = find_path(_map_of(arena), start.position, goal.position)
    if path is None:
        return None
    straight = torch.stack([start.position, goal.position])
    around, through = (waypoints_along(line, start, goal, _STEPS) for line in (smooth_path(path), straight))
    x, y, z = _ROBOT.body.extents
    for share in torch.linspace(0, 1, _SHARES + 1):
        free = _ROBOT.encode(around + share * (through - around), start, goal, _DT)
        trajectory = Trajectory(free, Route(start, goal, _STEPS, _DT))
        report = judge(arena.scene, _ROBOT.body, trajectory.motion(_ROBOT).states)
        if report.max_overlap_m3 >= item.depth * x * y * z:
            return trajectory
    return None


@per_arena
def _map_of(arena: Arena) -> OccupancyMap:
    return OccupancyMap.of(arena.field, _ROBOT.body)


_FEWEST = 4
"""Fewest observed iterations before the plan is free that give a correlation."""


def measures_of(rows: Sequence[Row]) -> tuple[Row, ...]:
    """Measures of each plan; no correlation (None) for one that is free from the start, or too soon."""
    measures = []
    for name, plan in zip(_names(rows), _plans(rows), strict=True):
        part = plan[: _first_free(plan) + 1]
        correlated = bool(plan[:, 1].max() > 0) and len(part) >= _FEWEST
        spearman = _spearman(part) if correlated else None
        measures.append({"task": name, "spearman": spearman, "final_overlap_m4": float(plan[-1, 1])})
    return tuple(measures)


def summarize(rows: Sequence[Row]) -> Row:
    """The correlations, and what is left of the overlap."""
    plans = _plans(rows)
    hit = [plan for plan in plans if plan[:, 1].max() > 0]
    until_free = [plan[: _first_free(plan) + 1] for plan in hit]
    each = [plan["spearman"] for plan in measures_of(rows) if plan["spearman"] is not None]
    return {
        "plans": len(plans),
        "plans_that_touched": len(hit),
        "plans_correlated": len(each),
        "spearman_median": float(np.median(each)) if each else None,
        "spearman_least": min(each, default=None),
        "spearman_pooled": _spearman(np.concatenate(until_free)) if until_free else None,
        "spearman_all_iterations": _spearman(np.concatenate(plans)) if hit else None,
        "final_overlap_m4_max": max((float(plan[-1, 1]) for plan in plans), default=None),
        "final_overlaps": sum(bool(plan[-1, 1] > 0) for plan in plans),
    }


def draw_figure(rows: Sequence[Row]) -> Figure:
    """Loss against overlap, and both over the iterations of the plan that overlapped most."""
    figure, (cloud, course) = panels(("Every watched iteration", "One plan"), height=3.8)
    worst = max(rows, key=lambda row: row["overlap_m4"], default=None)
    for index, name in enumerate(_names(rows)):
        mine = [row for row in rows if row["task"] == name and row["overlap_m4"] > 0]
        color = COLORS[index % len(COLORS)]
        cloud.plot([r["overlap_m4"] for r in mine], [r["loss"] for r in mine], ".", color=color, markersize=4)
    cloud.set(xscale="log", yscale="log", xlabel="overlap along the way [m$^4$]", ylabel="collision loss")
    if worst is not None:
        mine = [row for row in rows if row["task"] == worst["task"]]
        when = [row["iteration"] for row in mine]
        course.plot(when, [row["loss"] / mine[0]["loss"] for row in mine], color=COLORS[0], label="loss")
        course.plot(when, [row["overlap_m4"] / worst["overlap_m4"] for row in mine], color=COLORS[1], label="overlap")
        course.set(xlabel="iteration", ylabel="share of the start's / the largest")
        course.legend(frameon=False, fontsize=9)
    return figure


def _names(rows: Sequence[Row]) -> list[str]:
    return list(dict.fromkeys(row["task"] for row in rows))


def _plans(rows: Sequence[Row]) -> list[np.ndarray]:
    """Observations (loss, overlap) of each plan."""
    return [
        np.array([(row["loss"], row["overlap_m4"]) for row in rows if row["task"] == name]) for name in _names(rows)
    ]


def _first_free(plan: np.ndarray) -> int:
    """Index of the first observation (loss, overlap) without a contact; the last one if there is none."""
    free = np.flatnonzero(plan[:, 1] == 0)
    return int(free[0]) if len(free) else len(plan) - 1


def _spearman(plan: np.ndarray) -> float:
    return float(np.corrcoef(scipy.stats.rankdata(plan[:, 0]), scipy.stats.rankdata(plan[:, 1]))[0, 1])

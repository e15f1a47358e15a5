"""Planners side by side on the same flights, judged on the ground truth: the paper's comparison of planners.

Each trial is one planner on one task. What a plan costs is measured alike for all, with the robot's bare body:

    collision   sum over steps and body points of rho(x_b) s(b), paper Eq. 1
    effort      sum over steps of u' Gamma u
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import torch

from nerfnav.experiments.arena import Arena
from nerfnav.experiments.contenders import ROBOT, contender_for, missing
from nerfnav.experiments.planners_results import PLANNERS, picture, summary_of
from nerfnav.experiments.study import ExperimentStep, Results, Row, Study, run_trials
from nerfnav.planner import PlanOutcome, PlanStep, Route, collision_per_step
from nerfnav.planner.risk.costs import control
from nerfnav.world import Task, judge

_STEPS, _DT = 20, 0.1
"""Length of a flight: 2 s, as in the paper."""
_ARRIVED = 0.1
"""How near to the goal a flight must end [m]: one body."""
_SAMPLES = 10
"""Densities taken along each body point's way through a step to measure a collision cost, about 1 cm apart."""
_NO_PLAN = (PlanOutcome.NO_PATH, PlanOutcome.TIME_LIMIT, PlanOutcome.DIVERGED)


@dataclass(frozen=True)
class Flight:
    """One trial."""

    planner: str
    """One of PLANNERS."""
    task: Task
    """From where to where."""
    seed: int
    """Of what is random in the planner, at least 1."""


def run(study: Study) -> Iterator[ExperimentStep]:
    """Plan every task with every planner; a flight fails that touches, misses its goal, or has no plan."""
    tasks, left_out = study.first(study.tasks, "tasks"), missing()
    flights = [
        Flight(name, task, 1 + study.seed * len(tasks) + index)
        for index, task in enumerate(tasks)
        for name in PLANNERS
        if name not in left_out
    ]
    rows = yield from run_trials(study, "planning", fly, flights)
    told = {"left_out": left_out} if left_out else {}
    yield Results(summary_of(rows) | told, tuple(rows), {"planners": partial(picture, rows)})


def fly(arena: Arena, flight: Flight) -> Row:
    """Plan one flight and judge it."""
    contender = contender_for(arena, flight.planner, flight.seed)
    begun = time.perf_counter()
    *_, last = contender.plan(Route(flight.task.start_state, flight.task.goal_state, _STEPS, _DT))
    return _row(arena, flight, last, 1e3 * (time.perf_counter() - begun))


def _row(arena: Arena, flight: Flight, plan: PlanStep, plan_ms: float) -> Row:
    motion, goal = plan.motion, flight.task.goal_state.position
    report = judge(arena.scene, ROBOT.body, motion.states)
    missed_m = (motion.states.position[-1] - goal).norm().item()
    touched = bool(report.touched_poses.any())
    return {
        "task": flight.task.name,
        "planner": flight.planner,
        "outcome": plan.outcome.name.lower() if plan.outcome else "",
        "failed": touched or plan.outcome in _NO_PLAN or missed_m > _ARRIVED,
        "touched": touched,
        "max_overlap_m3": report.max_overlap_m3,
        "goal_missed_by_m": missed_m,
        "collision": collision_per_step(arena.field, motion, ROBOT.body, _SAMPLES).sum().item(),
        "effort": control(motion, torch.tensor(ROBOT.action_weights)).item(),
        "plan_ms": plan_ms,
    }

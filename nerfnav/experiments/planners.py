"""Comparison of planners (paper): plan the same flights side by side, judged on the ground truth.

Each trial is one planner on one task. What a plan costs is measured alike for all, with the robot's bare body:

    collision   sum over steps and body points of rho(x_b) s(b), paper Eq. 1
    effort      sum over steps of u' Gamma u
"""

import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import torch

from nerfnav.core.errors import MissingExtraError
from nerfnav.core.steps import run_steps
from nerfnav.experiments.arena import Arena, per_arena
from nerfnav.experiments.figures import Figure, bars, panels
from nerfnav.experiments.study import ExperimentSteps, Results, Row, Study, run_trials
from nerfnav.planner import (
    OccupancyMap,
    Planner,
    PlanOutcome,
    PlanResult,
    Route,
    RRTConfig,
    collision_per_step,
    planners,
)
from nerfnav.planner.baselines.rrt import BallCheck, ball_check, require_ompl
from nerfnav.planner.risk.costs import control
from nerfnav.robots import Quadrotor
from nerfnav.world import Task, judge

PLANNERS = ("nerfnav", "minsnap", "rrt")
"""Contenders: all whose libraries are installed; the summary names the others under `left_out`."""
ROBOT = Quadrotor()
"""Robot of all contenders."""


def missing_planners() -> Row:
    """Planners whose library is not installed, and what to do about it."""
    try:
        require_ompl()
    except MissingExtraError as error:
        return {"rrt": str(error)}
    return {}


def make_contender(arena: Arena, name: str, seed: int) -> Planner:
    """The planner of that name, with its maps made before; `seed` is of what is random in it."""
    occupancy, check = _maps(arena)
    if name == "rrt":
        return planners.load("rrt").make(arena.field, ROBOT, RRTConfig(seed=seed), occupancy=occupancy, check=check)
    return planners.load("fast" if name == "nerfnav" else name).make(arena.field, ROBOT, occupancy=occupancy)


@per_arena
def _maps(arena: Arena) -> tuple[OccupancyMap, BallCheck]:
    """Maps of the field for the planners, made once."""
    return OccupancyMap.of(arena.field, ROBOT.body), ball_check(arena.field, ROBOT, RRTConfig())


_STEPS, _DT = 20, 0.1
"""Length of a flight: 2 s, as in the paper."""
ARRIVED = 0.1
"""Largest distance from the goal at the end of a flight [m]: one body."""
_SAMPLES = 10
"""Densities taken along each body point's path through a step to measure a collision cost, about 1 cm apart."""
NO_PLAN = (PlanOutcome.NO_PATH, PlanOutcome.TIME_LIMIT, PlanOutcome.DIVERGED)


@dataclass(frozen=True)
class Flight:
    """Trial of the experiment: one planner on one task."""

    planner: str
    """One of PLANNERS."""
    task: Task
    """From where to where."""
    seed: int
    """Of what is random in the planner, at least 1."""


def run(study: Study) -> ExperimentSteps:
    """Plan every task with every planner; a flight fails that touches, misses its goal, or has no plan."""
    tasks, left_out = study.first(study.tasks, "tasks"), missing_planners()
    flights = [
        Flight(name, task, 1 + study.seed * len(tasks) + index)
        for index, task in enumerate(tasks)
        for name in PLANNERS
        if name not in left_out
    ]
    rows = yield from run_trials(study, "planning", fly, flights)
    note = {"left_out": left_out} if left_out else {}
    return Results(summarize(rows) | note, tuple(rows), {"planners": partial(draw_figure, rows)}, ("planner",))


def fly(arena: Arena, flight: Flight) -> Row:
    """Plan one flight and judge it."""
    contender = make_contender(arena, flight.planner, flight.seed)
    begun = time.perf_counter()
    planned = run_steps(contender.plan(Route(flight.task.start_state, flight.task.goal_state, _STEPS, _DT)))
    return _row(arena, flight, planned, 1e3 * (time.perf_counter() - begun))


def _row(arena: Arena, flight: Flight, plan: PlanResult, plan_ms: float) -> Row:
    motion, goal = plan.motion, flight.task.goal_state.position
    report = judge(arena.scene, ROBOT.body, motion.states)
    missed_m = (motion.states.position[-1] - goal).norm().item()
    touched = bool(report.touched_poses.any())
    return {
        "task": flight.task.name,
        "planner": flight.planner,
        "outcome": plan.outcome.name.lower(),
        "failed": touched or plan.outcome in NO_PLAN or missed_m > ARRIVED,
        "touched": touched,
        "max_overlap_m3": report.max_overlap_m3,
        "goal_missed_by_m": missed_m,
        "collision": collision_per_step(arena.field, motion, ROBOT.body, _SAMPLES).sum().item(),
        "effort": control(motion, torch.tensor(ROBOT.action_weights)).item(),
        "plan_ms": plan_ms,
    }


def summarize(rows: Sequence[Row]) -> dict[str, Row]:
    """Summarize the failures and mean costs of each planner."""
    return {
        name: {
            "flights": len(mine),
            "failures": sum(row["failed"] for row in mine),
            "touched": sum(row["touched"] for row in mine),
            "collision_mean": statistics.fmean(row["collision"] for row in mine),
            "collision_median": statistics.median(row["collision"] for row in mine),
            "effort_mean": statistics.fmean(row["effort"] for row in mine),
            "effort_median": statistics.median(row["effort"] for row in mine),
            "plan_ms_median": statistics.median(row["plan_ms"] for row in mine),
        }
        for name, mine in _by_planner(rows).items()
    }


def draw_figure(rows: Sequence[Row]) -> Figure:
    """Bars as in the paper's figure, and every flight as a dot."""
    figure, (collision, effort, failures) = panels(("Collision cost (Eq. 1)", "Control effort", "Failed flights"))
    flights = _by_planner(rows)
    for axes, key, unit in ((collision, "collision", "sum of density x way"), (effort, "effort", "sum of u' Gamma u")):
        samples = {name: [row[key] for row in mine] for name, mine in flights.items()}
        axes.set_yscale("log")
        bars(axes, {name: statistics.fmean(values) for name, values in samples.items()}, unit + ", mean", samples)
    failed = {name: float(sum(row["failed"] for row in mine)) for name, mine in flights.items()}
    bars(failures, failed, f"of {len(rows) // len(flights)}")
    return figure


def _by_planner(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Rows of each planner that took part, in the order of PLANNERS."""
    found = {name: [row for row in rows if row["planner"] == name] for name in PLANNERS}
    return {name: mine for name, mine in found.items() if mine}

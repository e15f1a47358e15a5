"""Planners side by side on the same flights, judged on the ground truth: the paper's comparison of planners.

Each trial is one planner on one task. What a plan costs is measured alike for all, with the robot's bare body:

    collision   sum over steps and body points of rho(x_b) s(b), paper Eq. 1
    effort      sum over steps of u' Gamma u
"""

import statistics
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import TYPE_CHECKING

import torch

from nerfnav.errors import MissingExtraError
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.figures import bars, panels
from nerfnav.experiments.study import ExperimentStep, Results, Row, Study, run_trials
from nerfnav.planner import planners
from nerfnav.planner.clearance import BallCheck
from nerfnav.planner.costs import collision_per_step, control
from nerfnav.planner.occupancy import OccupancyMap
from nerfnav.planner.planner import Planner
from nerfnav.planner.route import Route
from nerfnav.planner.rrt import RRTConfig, ball_check, require_ompl
from nerfnav.planner.steps import PlanOutcome, PlanStep
from nerfnav.robots.quadrotor import Quadrotor
from nerfnav.world.contact import judge
from nerfnav.world.task import Task

if TYPE_CHECKING:
    import matplotlib.figure

PLANNERS = ("nerfnav", "minsnap", "rrt")
"""Who takes part: all whose libraries are installed; the summary names the others under `left_out`."""
_STEPS, _DT = 20, 0.1
"""Length of a flight: 2 s, as in the paper."""
_ARRIVED = 0.1
"""How near to the goal a flight must end [m]: one body."""
_SAMPLES = 10
"""Densities taken along each body point's way through a step to measure a collision cost, about 1 cm apart."""
_NO_PLAN = (PlanOutcome.NO_PATH, PlanOutcome.TIME_LIMIT, PlanOutcome.DIVERGED)
_ROBOT = Quadrotor()


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
    tasks, left_out = study.first(study.tasks, "tasks"), _left_out()
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
    contender = _contender(arena, flight)
    begun = time.perf_counter()
    *_, last = contender.plan(Route(flight.task.start_state, flight.task.goal_state, _STEPS, _DT))
    return _row(arena, flight, last, 1e3 * (time.perf_counter() - begun))


def summary_of(rows: Sequence[Row]) -> dict[str, Row]:
    """For each planner: its failures and what its plans cost on average."""
    summary = {}
    for name in _contenders(rows):
        mine = [row for row in rows if row["planner"] == name]
        summary[name] = {
            "flights": len(mine),
            "failures": sum(row["failed"] for row in mine),
            "touched": sum(row["touched"] for row in mine),
            "collision_mean": statistics.fmean(row["collision"] for row in mine),
            "collision_median": statistics.median(row["collision"] for row in mine),
            "effort_mean": statistics.fmean(row["effort"] for row in mine),
            "effort_median": statistics.median(row["effort"] for row in mine),
            "plan_ms_median": statistics.median(row["plan_ms"] for row in mine),
        }
    return summary


def picture(rows: Sequence[Row]) -> "matplotlib.figure.Figure":
    """Bars as in the paper's figure, and every flight as a dot."""
    figure, (collision, effort, failures) = panels(("Collision cost (Eq. 1)", "Control effort", "Failed flights"))
    names = _contenders(rows)
    for axes, key, unit in ((collision, "collision", "sum of density x way"), (effort, "effort", "sum of u' Gamma u")):
        spread = {name: [row[key] for row in rows if row["planner"] == name] for name in names}
        axes.set_yscale("log")
        bars(axes, {name: statistics.fmean(values) for name, values in spread.items()}, unit + ", mean", spread)
    failed = {name: float(sum(row["failed"] for row in rows if row["planner"] == name)) for name in names}
    bars(failures, failed, f"of {len(rows) // len(names)}")
    return figure


def _row(arena: Arena, flight: Flight, plan: PlanStep, plan_ms: float) -> Row:
    motion, goal = plan.motion, flight.task.goal_state.position
    report = judge(arena.scene, _ROBOT.body, motion.states)
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
        "collision": collision_per_step(arena.field, motion, _ROBOT.body, _SAMPLES).sum().item(),
        "effort": control(motion, torch.tensor(_ROBOT.action_weights)).item(),
        "plan_ms": plan_ms,
    }


def _left_out() -> Row:
    """Planners whose library is not installed, and what to do about it."""
    try:
        require_ompl()
    except MissingExtraError as error:
        return {"rrt": str(error)}
    return {}


def _contenders(rows: Sequence[Row]) -> tuple[str, ...]:
    """The planners that took part, in the order of PLANNERS."""
    return tuple(name for name in PLANNERS if any(row["planner"] == name for row in rows))


def _contender(arena: Arena, flight: Flight) -> Planner:
    """The planner of a flight, with its maps made before."""
    occupancy, check = _maps(arena)
    if flight.planner == "rrt":
        tree = RRTConfig(seed=flight.seed)
        return planners.load("rrt").make(arena.field, _ROBOT, tree, occupancy=occupancy, check=check)
    known_as = {"nerfnav": "fast"}.get(flight.planner, flight.planner)
    return planners.load(known_as).make(arena.field, _ROBOT, occupancy=occupancy)


@lru_cache(maxsize=2)
def _maps(arena: Arena) -> tuple[OccupancyMap, BallCheck]:
    """What planners know of the field, made once."""
    occupancy = OccupancyMap.of(arena.field, _ROBOT.body)
    return occupancy, ball_check(arena.field, _ROBOT, RRTConfig())

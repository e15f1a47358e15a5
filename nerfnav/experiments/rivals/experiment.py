"""Rivals: other people's planners and nerfnav's on the same flights, judged on the ground truth.

Trial k plans one pair of ends with every planner in turn, on one thread of one process. Even trials have the ends of
the place's tasks while there are some, all others random ends that are drawn by the seed S + k, which seeds what is
random in planners too. The duration is that of nerfnav's flights: 2 s for tasks where that suffices, else as long as
the path takes. Random ends are free with 8 cm to spare, for nerfnav's map too.

    solved   a path from start to goal was returned
    clean    solved, and flown over the duration it ends within 10 cm of the goal and touches nothing: the body on the
             true mesh, at 100 Hz or more. A plan without times is flown along its smoothed path
    J        Eq. 2, collision and control of the bare body in the trained field, of every path smoothed and eased over
             the duration in the same way; its median is over the pairs that all planners solved
    J_own    the same of a plan as it is, where it has times

Times are of the calls alone, over all pairs: what is made once for a place, such as maps and trees of points, and a
first call are not in them.
"""

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import torch

from nerfnav.core.registry import Registry
from nerfnav.experiments.arena import Arena, per_arena
from nerfnav.experiments.closed_loop import quantile
from nerfnav.experiments.closed_loop_flight import FlightTrial, find_task, make_problem
from nerfnav.experiments.figures import COLORS, Figure, bars, draw_distribution, panels
from nerfnav.experiments.planners import ARRIVED, ROBOT
from nerfnav.experiments.replanning import cost_per_step
from nerfnav.experiments.rivals.flask_planner import FLASK
from nerfnav.experiments.rivals.own import MINIMUM_SNAP, NERFNAV, RRT
from nerfnav.experiments.rivals.rival import Answer, Plan, Rival
from nerfnav.experiments.rivals.vamp_planner import VAMP
from nerfnav.experiments.study import ExperimentSteps, Results, Row, Study, run_trials
from nerfnav.planner import PlanProblem
from nerfnav.planner.space.astar import smooth_path, waypoints_along
from nerfnav.robots import Motion, RigidState
from nerfnav.world import judge

RIVALS: Registry[Rival] = Registry("planner", (NERFNAV, MINIMUM_SNAP, RRT, FLASK, VAMP))
"""Planners by name, in the order of the table."""
_PAIRS = 30
"""Trials in each place."""
_JUDGED_HZ = 100


@dataclass(frozen=True)
class Pair:
    """Trial of the experiment: one pair of ends, and the planners that plan between them."""

    ends: FlightTrial
    """Task or random ends, and seed."""
    planners: tuple[str, ...]
    """Names of RIVALS."""

    @property
    def seed(self) -> int:
        """Seed of everything random in it."""
        return self.ends.seed


def run(study: Study) -> ExperimentSteps:
    """Plan all pairs with every planner that is installed, here and in the places beside."""
    missing = {name: reason for name, rival in RIVALS.items() if (reason := rival.missing()) is not None}
    there = tuple(name for name in RIVALS if name not in missing)
    rows: list[Row] = []
    for where in (study, *study.beside):
        name = where.open_arena().scene.name
        answers = yield from run_trials(where, f"planning in {name}", compare, pairs_of(where, there))
        rows += [{"place": name} | row for answer in answers for row in answer]
    return Results(summarize(rows, missing), tuple(rows), {"rivals": partial(draw_figure, rows)}, ("place", "planner"))


def pairs_of(study: Study, planners: tuple[str, ...]) -> list[Pair]:
    """The trials in one place: a task and random ends by turns, then random ends."""
    tasks = [task for task in study.tasks if task.robot == ROBOT.name]
    even = {2 * index: task for index, task in enumerate(tasks)}
    count = study.trials or max(_PAIRS, 2 * len(tasks))
    return [Pair(FlightTrial(even.get(index), study.seed + index), planners) for index in range(count)]


def compare(arena: Arena, pair: Pair) -> list[Row]:
    """Plan one pair with each planner, and judge the answers."""
    task = find_task(arena, pair.ends)
    problem = make_problem(arena, task, pair.ends)
    known = {
        "ends": "random" if pair.ends.task is None else "tasks", "pair": task.name, "seed": pair.seed,
        "duration_s": problem.steps * problem.dt,
    }  # fmt: skip
    rows = []
    for name in pair.planners:
        answer = _make_plan(arena, name, problem)(problem, 1 + pair.seed)
        rows.append(known | {"planner": name} | judge_answer(arena, problem, answer))
    return rows


@per_arena
def _plans_in(arena: Arena) -> dict[str, Plan]:
    """Planners that are ready in a place."""
    return {}


def _make_plan(arena: Arena, name: str, problem: PlanProblem) -> Plan:
    """Get a planner ready, with a first call for what is loaded and compiled then."""
    ready = _plans_in(arena)
    if name not in ready:
        ready[name] = RIVALS[name].prepare(arena)
        ready[name](problem, 1)
    return ready[name]


def judge_answer(arena: Arena, problem: PlanProblem, answer: Answer) -> Row:
    """Numbers of one answer; None where there are none."""
    row: Row = {
        "solved": answer.path is not None, "clean": False, "reason": answer.reason, "plan_ms": answer.ms,
        "length_m": None, "touched": None, "goal_missed_by_m": None, "J": None, "J_own": None,
    }  # fmt: skip
    if answer.path is None:
        return row
    path = torch.from_numpy(answer.path).to(problem.start.position)
    smoothed = smooth(problem, path)
    flown = smoothed if answer.motion is None else answer.motion
    touched = bool(judge(arena.scene, problem.robot.body, at_rate(flown)).touched_poses.any())
    missed_m = (flown.states.position[-1] - problem.goal.position).norm().item()
    cost = partial(_cost, arena, problem)
    return row | {
        "clean": not touched and missed_m <= ARRIVED,
        "length_m": path.diff(dim=0).norm(dim=-1).sum().item(),
        "touched": touched,
        "goal_missed_by_m": missed_m,
        "J": cost(smoothed),
        "J_own": None if answer.motion is None else cost(answer.motion),
    }


def smooth(problem: PlanProblem, path: torch.Tensor) -> Motion:
    """Motion along a path (n, 3) [m] with rounded corners, eased over the duration of the problem."""
    waypoints = waypoints_along(smooth_path(path), problem.start, problem.goal, problem.steps)
    return problem.trajectory_through(waypoints).motion(problem.robot)


def at_rate(motion: Motion) -> RigidState:
    """States of a motion 100 times a second or more: straight lines and steady turns between its own."""
    parts = math.ceil(motion.dt * _JUDGED_HZ - 1e-6)
    index = torch.arange(len(motion.actions)).repeat_interleave(parts)
    share = torch.arange(parts).repeat(len(motion.actions))[:, None] / parts
    before = motion.states[:-1]
    between = before[index].retract(share * before.local(motion.states[1:])[index])
    return RigidState.cat([between, motion.states[-1:]])


def _cost(arena: Arena, problem: PlanProblem, motion: Motion) -> float:
    return cost_per_step(arena, problem.robot, motion).sum().item()


def summarize(rows: Sequence[Row], missing: Row) -> Row:
    """Counts, times and costs of each planner: together, by place, and by kind of ends."""
    together = _by_planner(rows)
    methods = {
        name: {"skipped": missing[name]} if name in missing else together[name] | _about(name) for name in RIVALS
    }
    return {
        "methods": methods,
        "places": {place: _by_planner(_where(rows, "place", place)) for place in dict.fromkeys(_all(rows, "place"))},
        "ends": {kind: _by_planner(_where(rows, "ends", kind)) for kind in dict.fromkeys(_all(rows, "ends"))},
        "solved_by_all": len(solved_by_all(rows)),
    }


def _about(name: str) -> Row:
    """Conditions of a planner's numbers: version, options and limits."""
    rival = RIVALS[name]
    return {"version": rival.version(), "options": rival.options, "does_not": rival.omits}


def solved_by_all(rows: Sequence[Row]) -> set[tuple[str, int]]:
    """Place and seed of the pairs that all planners solved."""
    failed = {(row["place"], row["seed"]) for row in rows if not row["solved"]}
    return {(row["place"], row["seed"]) for row in rows} - failed


def _by_planner(rows: Sequence[Row]) -> dict[str, Row]:
    """Numbers of each planner over some of the pairs."""
    compared = solved_by_all(rows)
    found = {}
    for name in dict.fromkeys(_all(rows, "planner")):
        mine = _where(rows, "planner", name)
        shared = [row for row in mine if (row["place"], row["seed"]) in compared]
        times = _all(mine, "plan_ms")
        found[name] = {
            "trials": len(mine),
            "solved": sum(row["solved"] for row in mine),
            "clean": sum(row["clean"] for row in mine),
            "time_p50_ms": quantile(times, 0.5),
            "time_p95_ms": quantile(times, 0.95),
            "J_median": quantile(_all(shared, "J"), 0.5),
            "J_own_median": quantile(_all(shared, "J_own"), 0.5),
        }
    return found


def _where(rows: Sequence[Row], key: str, value: str) -> list[Row]:
    return [row for row in rows if row[key] == value]


def _all(rows: Sequence[Row], key: str) -> list[Any]:
    """Values of a column, without those that do not exist."""
    return [row[key] for row in rows if row[key] is not None]


def draw_figure(rows: Sequence[Row]) -> Figure:
    """Shares of clean flights, distributions of times, and costs of the pairs that all solved."""
    figure, (clean, times, costs) = panels(("Clean flights", "Time of a plan", "J, smoothed alike"))
    numbers, compared = _by_planner(rows), solved_by_all(rows)
    bars(clean, {name: 100 * mine["clean"] / mine["trials"] for name, mine in numbers.items()}, "% of pairs")
    samples: dict[str, list[float]] = {}
    for index, name in enumerate(numbers):
        mine = _where(rows, "planner", name)
        draw_distribution(times, _all(mine, "plan_ms"), COLORS[index % len(COLORS)], name)
        samples[name] = _all([row for row in mine if (row["place"], row["seed"]) in compared], "J")
    times.set(xscale="log", xlabel="time at most [ms]", ylabel="share of plans", ylim=(0, 1))
    times.legend(frameon=False, fontsize=7)
    costs.set_yscale("log")
    medians = {name: statistics.median(values) for name, values in samples.items() if values}
    bars(costs, medians, "collision and control (Eq. 2), median", samples)
    for axes in (clean, costs):
        axes.tick_params(axis="x", labelsize=7, rotation=20)
    return figure

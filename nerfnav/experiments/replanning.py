"""Replanning (paper): the same first plan flown in closed loop by camera, and in open loop.

Trial k is flown twice with the seed S + k: by Algorithm 1, which plans again from the belief after every picture, and
blindly by the actions of the first plan. Start, first plan and noise of every step are the same. A contact is counted,
and the flight goes on.

Flights are judged by the true state: in open loop the believed one always arrives. `reached` counts flights that end
within the tolerance of the goal, `collided` those that touched something on the way, `clean` those that reached and
did not touch.

The cost of a flight sums Eq. 2's terms over all its steps, along the true path in the trained field, with the robot's
bare body; the planned cost is that of the first plan. A flight ends in closed loop where it has arrived, in open loop
with its plan, and in both where it leaves the field's box.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.closed_loop import outcome_by_truth, quantile, record_flight, trials_of, wilson
from nerfnav.experiments.closed_loop_flight import FlightTrial, find_task, fly_problem, make_problem
from nerfnav.experiments.figures import COLORS, Axes, Figure, panels
from nerfnav.experiments.ground_robots import outlines
from nerfnav.experiments.study import ExperimentSteps, Replay, Results, Row, Study, run_trials
from nerfnav.export import Recording
from nerfnav.navigation import NavigateConfig, NavigationStep
from nerfnav.planner import CostWeights, PlanProblem, TermContext, terms
from nerfnav.planner.terms.term import evaluate
from nerfnav.robots import Motion, Quadrotor, RigidState, Robot, load
from nerfnav.world import Task

LOOPS = ("closed", "open")
"""Ways in which each trial is flown."""


def run(study: Study) -> ExperimentSteps:
    """Fly all trials both ways, here and in the places beside.

    Raises InvalidInputError for flights with the state known, which this experiment has none of.
    """
    if study.flights.truth:
        raise InvalidInputError("replanning flies by camera and in open loop, not with the state known: drop --truth")
    found: dict[str, list[Row]] = {}
    left_out: Row = {}
    for where in (study, *study.beside):
        tasks, name = _tasks_of(where), where.open_arena().scene.name
        left_out |= {task.name: "it is for a robot on the ground" for task in where.tasks if task not in tasks}
        trials = trials_of(replace(where, tasks=tasks))
        found[name] = yield from run_trials(where, f"flying in {name}", fly, trials)
    rows = tuple({"place": name} | row for name, trials in found.items() for trial in trials for row in trial["rows"])
    summary: Row = {"places": {name: summarize([row for row in rows if row["place"] == name]) for name in found}}
    summary |= {"together": summarize(rows)} | ({"left_out": left_out} if left_out else {})
    arenas = [where.open_arena() for where in (study, *study.beside)]
    figures = {f"replanning_{here.scene.name}": partial(draw_figure, here, found[here.scene.name]) for here in arenas}
    first, here = trials_of(replace(study, tasks=_tasks_of(study)))[0], arenas[0]
    replays = {f"{loop}_loop": Replay(here.scene.name, partial(record, here, first, loop)) for loop in LOOPS}
    return Results(summary, rows, figures, ("place", "loop"), replays=replays)


def _tasks_of(study: Study) -> tuple[Task, ...]:
    """The tasks of quadrotors, or all where a robot was asked for, which then decides."""
    if study.flights.robot is not None:
        return study.tasks
    return tuple(task for task in study.tasks if isinstance(load(task.robot), Quadrotor))


def fly(arena: Arena, trial: FlightTrial) -> Row:
    """Fly a trial both ways: `rows` of the table, and what the figure draws: `paths` [m] and costs so far."""
    task = find_task(arena, trial)
    problem = make_problem(arena, task, trial)
    flown = fly_both(arena, problem, trial)
    plan, cost = first_plan_of(flown["closed"]), partial(costs_so_far, arena, problem.robot)
    motions = {} if plan is None else {**{loop: executed(flown[loop]) for loop in LOOPS}, "planned": plan}
    costs = {name: cost(motion) for name, motion in motions.items()}
    known = {"task": task.name, "robot": problem.robot.name, "seed": trial.seed}
    return {
        "rows": [known | {"loop": loop} | _row(problem, flown[loop], costs, loop) for loop in LOOPS],
        "task": task.name, "dt": problem.dt, "costs": costs,
        "paths": {name: motion.states.position.tolist() for name, motion in motions.items()},
        "plans": [cost(step.plan) for step in flown["closed"]] if motions else [],
    }  # fmt: skip


def record(arena: Arena, trial: FlightTrial, loop: str) -> Recording | None:
    """Fly a trial again and record one of its ways; None where it does not begin."""
    task = find_task(arena, trial)
    problem = make_problem(arena, task, trial)
    return record_flight(arena, task, problem.robot, fly_both(arena, problem, trial)[loop])


def fly_both(arena: Arena, problem: PlanProblem, trial: FlightTrial) -> dict[str, list[NavigationStep]]:
    """Fly a problem in closed loop, and its first plan in open loop under the same noise; time steps by loop.

    Without a first plan neither flies.
    """
    closed = fly_problem(arena, problem, trial)
    plan = first_plan_of(closed)
    blind = closed if plan is None else fly_problem(arena, problem, replace(trial, open_loop=True), plan)
    return {"closed": closed, "open": blind}


def first_plan_of(flown: Sequence[NavigationStep]) -> Motion | None:
    """The plan with which a flight began; None for a flight that did not begin."""
    return flown[0].first_plan if len(flown) > 1 else None


def executed(flown: Sequence[NavigationStep]) -> Motion:
    """True states of a flight of at least one step, with the actions that were flown."""
    actions = torch.stack([step.action for step in flown if step.action is not None])
    return Motion(RigidState.stack([step.truth for step in flown]), actions, flown[1].time - flown[0].time)


def cost_per_step(arena: Arena, robot: Robot, motion: Motion) -> Float[Tensor, " n"]:
    """Eq. 2's terms of every step: collision and control, with the weights of J and the bare body."""
    states = motion.states.map(lambda part: torch.stack([part[:-1], part[1:]], 1))
    each = Motion(states, motion.actions[:, None], motion.dt)
    context = TermContext(arena.field, robot, CostWeights(margin=0.0))
    return evaluate([terms.TERMS[name] for name in ("collision", "control")], context, each).total


def costs_so_far(arena: Arena, robot: Robot, motion: Motion) -> list[float]:
    """Cost at each time of a motion, 0 at its start."""
    return [0.0, *cost_per_step(arena, robot, motion).cumsum(0).tolist()]


def _row(problem: PlanProblem, flown: Sequence[NavigationStep], costs: dict[str, list[float]], loop: str) -> Row:
    """Numbers of one flight; None where there are none."""
    last, touches = flown[-1] if flown else None, sum(step.touched for step in flown)
    final = None if last is None else (last.truth.position - problem.goal.position).norm().item()
    reached = bool(costs) and final is not None and final <= NavigateConfig.goal_tolerance_m
    cost, planned = (costs[name][-1] if costs else None for name in (loop, "planned"))
    return {
        "outcome": outcome_by_truth(last, problem.goal),
        "flown": bool(costs),
        "reached": reached,
        "collided": touches > 0,
        "clean": reached and not touches,
        "touches": touches,
        "steps": max(0, len(flown) - 1),
        "planned_steps": problem.steps,
        "final_distance_m": final,
        "cost": cost,
        "planned_cost": planned,
        "cost_ratio": None if cost is None or planned is None else cost / planned,
    }


def summarize(rows: Sequence[Row]) -> dict[str, Row]:
    """Counts of the flights of each loop, with Wilson's interval of those that reach, and medians."""
    return {loop: _summary([row for row in rows if row["loop"] == loop]) for loop in LOOPS}


def _summary(rows: Sequence[Row]) -> Row:
    reached = sum(row["reached"] for row in rows)
    low, high = wilson(reached, len(rows))
    flown = [row for row in rows if row["flown"]]
    return {
        "trials": len(rows),
        "flown": len(flown),
        "reached": reached,
        "reached_low": low,
        "reached_high": high,
        "collided": sum(row["collided"] for row in rows),
        "clean": sum(row["clean"] for row in rows),
        "final_distance_median_m": quantile([row["final_distance_m"] for row in flown], 0.5),
        "final_distance_p95_m": quantile([row["final_distance_m"] for row in flown], 0.95),
        "cost_ratio_median": quantile([row["cost_ratio"] for row in flown], 0.5),
    }


def draw_figure(arena: Arena, trials: Sequence[Row]) -> Figure:
    """Plot the flights of the first trial's task from above, on the solids cut at their height, and the cost so far of
    the first trial, whose later plans begin at what it has cost and fade with their age."""
    from matplotlib.collections import LineCollection

    figure, (above, costs) = panels(("From above", "Cost so far, first trial"), height=3.8)
    drawn = [trial for trial in trials if trial["paths"] and trial["task"] == trials[0]["task"]]
    if not drawn:
        return figure
    first = drawn[0]
    for name, color in (dict(zip(LOOPS, COLORS, strict=False)) | {"planned": "black"}).items():
        style: dict[str, Any] = {"color": color, "linestyle": "-" if name in LOOPS else ":"}
        for trial in drawn if name in LOOPS else drawn[:1]:
            path, faint = np.array(trial["paths"][name]), trial is not first
            above.plot(path[:, 0], path[:, 1], linewidth=0.7 if faint else 1.6, alpha=0.4 if faint else 1.0, **style)
        _draw_cost(costs, first["costs"][name], first["dt"], label=name, **style)
    _draw_plans(costs, first)
    height = float(np.mean([point[2] for point in first["paths"]["planned"]]))
    walls = LineCollection(outlines(arena, height).tolist(), colors="0.45", linewidths=0.8)
    above.add_collection(walls, autolim=False)
    above.set(xlabel="x [m]", ylabel="y [m]")
    above.set_aspect("equal", adjustable="datalim")
    costs.set_yscale("log", nonpositive="mask")
    costs.set(xlabel="time [s]", ylabel="collision and control (Eq. 2)")
    costs.legend(frameon=False, fontsize=8)
    return figure


def _draw_cost(axes: Axes, costs: Sequence[float], dt: float, since: int = 0, **style: Any) -> None:
    axes.plot(dt * (since + np.arange(len(costs))), costs, **style)


def _draw_plans(axes: Axes, trial: Row) -> None:
    """Plans of the closed loop, each from its time step on, the older the fainter."""
    spent, plans = trial["costs"]["closed"], trial["plans"]
    for step, plan in enumerate(plans):
        ahead = [spent[step] + cost for cost in plan]
        _draw_cost(axes, ahead, trial["dt"], step, color=COLORS[0], linewidth=0.6, alpha=0.1 + 0.5 * step / len(plans))

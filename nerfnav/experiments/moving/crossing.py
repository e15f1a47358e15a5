"""Crossing: a box crosses the planned way of a robot that flies by camera through a trained place.

Trial k flies a task of the place (the tasks of quadrotors in turn) with the seed S + k. The box is a cube of 2.5 times
the robot's length. At a random time in the middle third of the plan its middle is where the plan is then; it moves
level, across the way within 30 degrees, from a random side, with 0.3, 0.6 or 1 times the plan's mean speed. It passes
through what stands. What the robot knows:

    alone        there is no box: the errors of the same flights without one
    unaware      the box is there, and is not announced: a test only where nearly all of these are hit
    unmasked     its motion is announced to the planner, and the filter compares its pixels with the field
    announced    the same, and the filter leaves its pixels out

    clean        arrived, and touched neither the box nor the place
    hit          touched the box, by the signed distance of the body's points along the true path
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from nerfnav.core.errors import InvalidInputError
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.closed_loop import mean, outcome_by_truth, quantile
from nerfnav.experiments.closed_loop_flight import FlightTrial, Traffic, first_plan, fly_problem, make_problem
from nerfnav.experiments.estimation import errors_of
from nerfnav.experiments.figures import Figure, bars, panels
from nerfnav.experiments.study import ExperimentSteps, Results, Row, Study, run_trials
from nerfnav.navigation import NavigationStep, SupervisorAction, SupervisorState
from nerfnav.obstacles import BoxShape, ConstantVelocity, Obstacle
from nerfnav.planner import Movers, PlanProblem
from nerfnav.robots import Motion, Quadrotor, RigidState, load
from nerfnav.world import Task

PACES = (0.3, 0.6, 1.0)
"""Speeds of the box, as shares of the plan's mean speed."""
KNOWS = ("alone", "unaware", "unmasked", "announced")
"""Knowledge of the robot, see above."""
_SIZE = 2.5
"""Edge of the box in lengths of the robot."""
_TRIALS = 50
_ASKEW = np.pi / 6
"""Largest angle between the box's way and the one straight across [rad]."""
_DRAWS = 100
_CLEAR = 0.05
"""Distance of the box from the robot's start at take-off, at least [m]."""


@dataclass(frozen=True)
class Crossing:
    """Trial of the experiment: one flight."""

    task: Task
    """Start and goal."""
    seed: int
    """Of the noise of the flight, and of the crossing."""
    knows: str
    """One of KNOWS."""
    pace: float
    """Speed of the box, as a share of the plan's mean speed; 0 without one."""


def run(study: Study) -> ExperimentSteps:
    """Fly all trials, here and in the places beside."""
    rows: list[Row] = []
    for where in (study, *study.beside):
        name = where.open_arena().scene.name
        found = yield from run_trials(where, f"crossing in {name}", fly, trials_of(where))
        rows += [{"place": name} | row for row in found]
    places = list(dict.fromkeys(row["place"] for row in rows))
    summary = {"places": {name: summarize([row for row in rows if row["place"] == name]) for name in places}}
    summary |= {"together": summarize(rows)}
    return Results(summary, tuple(rows), {"crossing": partial(draw_figure, rows)}, ("place", "knows", "pace"))


def trials_of(study: Study) -> list[Crossing]:
    """The flights. Raises InvalidInputError for a place without a task of a quadrotor."""
    tasks = [task for task in study.tasks if isinstance(load(task.robot), Quadrotor)]
    if not tasks:
        raise InvalidInputError("this place has no task of a quadrotor: name a scene that has one")
    flights = [(knows, pace) for knows in KNOWS for pace in ((0.0,) if knows == "alone" else PACES)]
    return [
        Crossing(tasks[index % len(tasks)], study.seed + index, knows, pace)
        for index in range(study.trials or _TRIALS)
        for knows, pace in flights
    ]


def fly(arena: Arena, trial: Crossing) -> Row:
    """Fly a trial, and measure it."""
    flight = FlightTrial(trial.task, trial.seed)
    problem = make_problem(arena, trial.task, flight)
    box = draw_box(arena, problem, trial)
    traffic = None if trial.pace == 0 else Traffic(box, trial.knows != "unaware", trial.knows == "announced")
    flown = fly_problem(arena, problem, flight, traffic=traffic)
    known: Row = {"task": trial.task.name, "seed": trial.seed, "knows": trial.knows, "pace": trial.pace}
    return known | _row(problem, flown, None if traffic is None else box)


def draw_box(arena: Arena, problem: PlanProblem, trial: Crossing) -> Movers:
    """Draw the box of a trial, the same whatever the robot knows; again where it would begin at the robot's start.

    Raises InvalidInputError where each one does.
    """
    plan, robot = _plan_of(arena, trial.task), problem.robot
    path, times = plan.states.position.double().numpy(), plan.dt * np.arange(len(plan.actions) + 1)
    speed = (trial.pace or PACES[0]) * np.linalg.norm(np.diff(path, axis=0), axis=1).sum() / times[-1]
    draws, edge = np.random.default_rng(trial.seed), _SIZE * max(robot.body.extents)
    start = RigidState.stack([problem.start, problem.start])
    for _ in range(_DRAWS):
        at = float(times[-1] * draws.uniform(1 / 3, 2 / 3))
        turn = draws.uniform(-_ASKEW, _ASKEW) + draws.choice((-0.5, 0.5)) * np.pi
        place, ahead = _along(path, times, at), _along(path, times, at + plan.dt) - _along(path, times, at - plan.dt)
        yaw = float(np.arctan2(ahead[1], ahead[0]) + turn)
        velocity = speed * np.array([np.cos(yaw), np.sin(yaw), 0.0])
        x, y, z = (float(number) for number in place - at * velocity)
        motion = ConstantVelocity((float(velocity[0]), float(velocity[1]), 0.0))
        movers = Movers((Obstacle("box", BoxShape((edge, edge, edge)), (x, y, z), (0.0, 0.0, yaw), motion),))
        if movers.least_gaps(start, problem.dt, robot.body, 0.0).min() > _CLEAR:
            return movers
    raise InvalidInputError(f"every box that crosses {trial.task.name!r} begins at the robot's start")


def _along(path: Float[np.ndarray, "n 3"], times: Float[np.ndarray, " n"], at: float) -> Float[np.ndarray, "3"]:
    return np.array([np.interp(at, times, axis) for axis in path.T])


@lru_cache(maxsize=64)
def _plan_of(arena: Arena, task: Task) -> Motion:
    """First plan of a task without a box, which does not depend on the seed."""
    trial = FlightTrial(task, 0)
    plan = first_plan(arena, make_problem(arena, task, trial), trial)
    if plan is None:
        raise InvalidInputError(f"{task.name!r} has no plan that could be crossed")
    return plan


def _row(problem: PlanProblem, flown: Sequence[NavigationStep], box: Movers | None) -> Row:
    """Numbers of a flight; None where there are none."""
    outcome = outcome_by_truth(flown[-1] if flown else None, problem.goal)
    gaps = [
        box.least_gaps(RigidState.stack([a.truth, b.truth]), problem.dt, problem.robot.body, a.time).min()
        for a, b in pairwise(flown)
        if box is not None
    ]
    errors = [errors_of(step.belief, step.truth) for step in flown[1:]]
    touches = sum(step.touched for step in flown)
    replans = [step.replan_ms for step in flown[2:]]  # the first one waits for kernels that are compiled then
    return {
        "outcome": outcome,
        "clean": outcome == "reached" and touches == 0,
        "hit": bool(gaps) and bool(min(gaps) <= 0),
        "touches": touches,
        "least_distance_m": float(min(gaps)) if gaps else None,
        "steps": max(0, len(flown) - 1),
        "planned_steps": problem.steps,
        "position_median_m": quantile([error["position_m"] for error in errors], 0.5),
        "position_p95_m": quantile([error["position_m"] for error in errors], 0.95),
        "nees_pose_mean": mean([error["nees_pose"] for error in errors]),
        "lost": any(step.state is SupervisorState.LOST for step in flown),
        "held": sum(step.holds for step in flown),
        "backups": sum(step.recovery is SupervisorAction.BACKUP for step in flown),
        "new_plans": sum(step.restart is not None for step in flown),
        "replan_p50_ms": quantile(replans, 0.5),
        "replan_p95_ms": quantile(replans, 0.95),
    }


def summarize(rows: Sequence[Row]) -> Row:
    """Counts by what the robot knows and by the speed of the box, with errors beside those of the flights alone."""
    alone = _numbers([row for row in rows if row["knows"] == "alone"])
    found: Row = {"alone": alone}
    for knows in KNOWS[1:]:
        mine = [row for row in rows if row["knows"] == knows]
        paces = {f"pace_{pace:g}": _numbers([row for row in mine if row["pace"] == pace]) for pace in PACES}
        for numbers in paces.values():
            usual, error = alone["position_median_m"], numbers["position_median_m"]
            numbers["error_ratio"] = error / usual if usual and error is not None else None
        found[knows] = paces
    return found


def _numbers(rows: Sequence[Row]) -> Row:
    def values(name: str) -> list[float]:
        return [row[name] for row in rows if row[name] is not None]

    return {
        "trials": len(rows),
        **{name: sum(bool(row[name]) for row in rows) for name in ("clean", "hit", "lost")},
        "collided": sum(row["touches"] > 0 for row in rows),
        "least_distance_median_m": quantile(values("least_distance_m"), 0.5),
        "steps_median": quantile(values("steps"), 0.5),
        "position_median_m": quantile(values("position_median_m"), 0.5),
        "position_p95_m": quantile(values("position_p95_m"), 0.5),
        "nees_pose_mean": mean(values("nees_pose_mean")),
        "replan_p50_ms": quantile(values("replan_p50_ms"), 0.5),
        "replan_p95_ms": quantile(values("replan_p95_ms"), 0.5),
    }


def draw_figure(rows: Sequence[Row]) -> Figure:
    """Plot the flights that are hit and those that are clean, by what the robot knows and by the speed of the box."""
    figure, axes = panels(("Hit by the box", "Arrived, and touched nothing"))
    for axis, name in zip(axes, ("hit", "clean"), strict=True):
        shares = {
            f"{knows}\n{pace:g}": 100 * float(np.mean([bool(row[name]) for row in some]))
            for knows in KNOWS
            for pace in (0.0, *PACES)
            if (some := [row for row in rows if (row["knows"], row["pace"]) == (knows, pace)])
        }
        bars(axis, shares, "% of flights")
        axis.tick_params(axis="x", labelsize=6, rotation=60)
    return figure

"""Crossing: a box crosses the planned way of a robot that flies by camera through a trained place.

Trial k flies a task of the place (the tasks of quadrotors in turn) with the seed S + k. The box is a cube of 2.5 times
the robot's length. At a random time in the middle third of the plan its middle is where the plan is then; it moves
level, across the way within 30 degrees, from a random side, with 0.3, 0.6 or 1 times the plan's mean speed. It passes
through what stands. What the robot knows:

    alone        there is no box: the errors of the same flights without one
    unaware      the box is there, and is not announced: a test only where nearly all of these are hit
    unmasked     its motion is announced to the planner, and the filter compares its pixels with the field
    announced    the same, and the filter leaves its pixels out
    watching     there is no box, and the robot watches: the errors of `seen` beside, and what it sees where nothing is
    seen         the box is not announced, and the robot watches
    seen_unmasked    the same, and the filter compares its pixels with the field

A box is in view if it shows in two pictures in a row from the plan of a robot that watches, the later one at least
0.4 s before they meet; flights of other boxes are counted apart.

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
from nerfnav.experiments.arena import Arena, make_renderer
from nerfnav.experiments.closed_loop import mean, outcome_by_truth, quantile
from nerfnav.experiments.closed_loop_flight import FlightTrial, Traffic, first_plan, fly_problem, make_problem
from nerfnav.experiments.estimation import errors_of
from nerfnav.experiments.figures import Figure, bars, panels
from nerfnav.experiments.study import ExperimentSteps, Results, Row, Study, run_trials
from nerfnav.navigation import NavigationStep, SupervisorAction, SupervisorState
from nerfnav.obstacles import BoxShape, ConstantVelocity, Obstacle, Overlay
from nerfnav.planner import Movers, PlanProblem
from nerfnav.robots import Motion, Quadrotor, RigidState, load
from nerfnav.world import Task

_ALONE = ("alone", "watching")
"""Of these, those without a box."""
PACES = (0.3, 0.6, 1.0)
"""Speeds of the box, as shares of the plan's mean speed."""
KNOWS = ("alone", "watching", "unaware", "unmasked", "announced", "seen", "seen_unmasked")
"""Knowledge of the robot, see above."""
_SIZE = 2.5
"""Edge of the box in lengths of the robot."""
_TRIALS = 50
_ASKEW = np.pi / 6
"""Largest angle between the box's way and the one straight across [rad]."""
_DRAWS = 100
IN_TIME_S = 0.4
"""Time before the meeting at which a box that is in view shows, at least [s]."""
_SHOWS = 100
"""Pixels in which it shows, at least."""
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
    flights = [(knows, pace) for knows in KNOWS for pace in ((0.0,) if knows in _ALONE else PACES)]
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
    there, knows = None if trial.pace == 0 else box, trial.knows
    traffic = Traffic(
        there,
        knows in ("announced", "unmasked"),
        "unmasked" not in knows,
        knows in ("watching", "seen", "seen_unmasked"),
    )
    flown = fly_problem(arena, problem, flight, traffic=None if knows == "alone" else traffic)
    known: Row = {"task": trial.task.name, "seed": trial.seed, "knows": knows, "pace": trial.pace}
    known |= {"in_view": None if there is None else is_in_view(arena, problem, trial, box)}
    return known | _row(problem, flown, there)


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


def is_in_view(arena: Arena, problem: PlanProblem, trial: Crossing, box: Movers) -> bool:
    """Check whether the camera of a robot that flies the plan shows the box in time: in two pictures in a row, the
    later one at least IN_TIME_S before they meet."""
    flight = FlightTrial(trial.task, trial.seed)
    plan, robot = first_plan(arena, problem, flight, Traffic(box, announced=False, watched=True)), problem.robot
    if plan is None:
        return False
    touched = np.flatnonzero(box.least_gaps(plan.states, plan.dt, robot.body, 0.0) <= 0)
    latest = int((float(touched[0]) * plan.dt - IN_TIME_S) / plan.dt + 1e-6) if len(touched) else -1
    overlay, renderer, before = Overlay(box.obstacles), make_renderer(arena), False
    for step in range(latest + 1):
        pose = plan.states[step].pose.compose(robot.mount)
        if not overlay.covered(robot.camera, pose, step * plan.dt, 0.0).sum() >= _SHOWS:
            before = False
            continue
        seen = renderer.render(robot.camera, pose)
        drawn = overlay.draw(seen.image, seen.fine_depth, robot.camera, pose, step * plan.dt)
        shown = bool((drawn != seen.image).any(-1).sum() >= _SHOWS)
        if shown and before:
            return True
        before = shown
    return False


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
        **_sightings(flown),
        "new_plans": sum(step.restart is not None for step in flown),
        "replan_p50_ms": quantile(replans, 0.5),
        "replan_p95_ms": quantile(replans, 0.95),
    }


def _sightings(flown: Sequence[NavigationStep]) -> Row:
    """Number of time steps in which a robot that watches saw something, the first time, and how long it then took to a
    new plan or the fallback [s]."""
    seen = [step for step in flown if step.seen_movers is not None]
    answers = [
        step.time - seen[0].time
        for step in flown
        if seen and step.time >= seen[0].time
        and (step.restart is not None or step.recovery is SupervisorAction.BACKUP)
    ]  # fmt: skip
    return {
        "seen_steps": len(seen),
        "first_seen_s": seen[0].time if seen else None,
        "answer_s": answers[0] if answers else None,
    }


def summarize(rows: Sequence[Row]) -> Row:
    """Counts by what the robot knows and by the speed of the box, with errors beside those of the flights alone."""
    found: Row = {knows: _numbers([row for row in rows if row["knows"] == knows]) for knows in _ALONE}
    for knows in KNOWS[len(_ALONE) :]:
        mine = [row for row in rows if row["knows"] == knows]
        apart = {"": mine}
        if knows.startswith("seen"):
            apart = {f"_{name}": [row for row in mine if row["in_view"] is shows]
                     for name, shows in (("in_view", True), ("outside", False))}  # fmt: skip
        alone = found["watching" if knows.startswith("seen") else "alone"]
        for name, some in apart.items():
            paces = {f"pace_{pace:g}": _numbers([row for row in some if row["pace"] == pace]) for pace in PACES}
            for numbers in paces.values():
                usual, error = alone["position_median_m"], numbers["position_median_m"]
                numbers["error_ratio"] = error / usual if usual and error is not None else None
            found[knows + name] = paces
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
        "seen_steps": sum(row["seen_steps"] for row in rows),
        "first_seen_median_s": quantile(values("first_seen_s"), 0.5),
        "answer_median_s": quantile(values("answer_s"), 0.5),
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

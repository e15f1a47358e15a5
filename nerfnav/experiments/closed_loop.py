"""Closed loop: fly by Algorithm 1 with the camera alone, and count arrivals, errors, and errors that go unnoticed.

Trial k is flown with the seed S + k, between the ends of a task of the place (the tasks in turn) or random ends (at
rest anywhere, with 8 cm to spare on the mesh and free for the planner, as long as the path takes). With `robot` that
one flies, between random ends or those of the tasks of its kind. With `truth` each flight is flown again with the
same noise and the state known. Equal seeds give equal flights; with more trials the first ones stay.

Shares of flights come with Wilson's score interval of 95 % (E. B. Wilson, "Probable inference, the law of succession,
and statistical inference", 1927).
"""

import math
from collections import Counter
from collections.abc import Sequence
from functools import partial
from itertools import chain

import numpy as np

from nerfnav.core.errors import InvalidInputError
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.closed_loop_flight import FlightTrial, find_task, fly_problem, make_problem
from nerfnav.experiments.estimation import errors_of
from nerfnav.experiments.figures import COLORS, Figure, draw_distribution, panels
from nerfnav.experiments.study import ExperimentSteps, Replay, Results, Row, Study, run_trials
from nerfnav.export import Recording
from nerfnav.navigation import EpisodeOutcome, NavigateConfig, NavigationStep, SupervisorState, is_silent
from nerfnav.robots import Quadrotor, RigidState, Robot, load
from nerfnav.world import Task

_TRIALS = 100
REFUSED = "refused"
"""Outcome where the field has something dense at an end."""


def run(study: Study) -> ExperimentSteps:
    """Fly all trials and count their outcomes."""
    flights = yield from run_trials(study, "flying", fly, trials_of(study))
    rows = tuple(flight["row"] for flight in flights)
    left = [task.name for task in study.tasks if task not in tasks_of(study)]
    robot = study.flights.robot
    why = "its robot is no quadrotor" if robot is None else f"its robot moves otherwise than {load(robot).name} does"
    note = {"left_out": dict.fromkeys(left, why)} if left else {}
    figures = {"flights": partial(draw_figure, flights)}
    return Results(summarize(flights) | note, rows, figures, ("ends", "state"), replays=_replays(study))


def trials_of(study: Study) -> list[FlightTrial]:
    """The flights, those with the state known right after those by camera."""
    flights = study.flights
    return [
        FlightTrial(
            _task(study, index),
            study.seed + index,
            known,
            flights.world,
            flights.risk_weight,
            flights.robot,
            flights.fly_on,
            imu=flights.imu,
        )
        for index in range(study.trials or _TRIALS)
        for known in ((False, True) if flights.truth else (False,))
    ]


def _task(study: Study, index: int) -> Task | None:
    """The task of a trial; None: random ends."""
    ends, tasks, robot = study.flights.ends, tasks_of(study), study.flights.robot
    if ends == "random" or (ends == "both" and index % 2):
        if robot is not None and not isinstance(load(robot), Quadrotor):
            raise InvalidInputError(f"random ends are anywhere in the air, where no {robot} can be: fly its tasks")
        return None
    if not tasks:
        raise InvalidInputError("this place has no tasks that could be flown here: ask for random ends")
    return tasks[(index // 2 if ends == "both" else index) % len(tasks)]


def tasks_of(study: Study) -> list[Task]:
    """The tasks that can be flown in the world that is asked for, by the kind of robot that is asked for."""
    flights = study.flights
    if flights.robot is not None:
        kind = type(load(flights.robot))
        return [task for task in study.tasks if type(load(task.robot)) is kind]
    return [task for task in study.tasks if flights.world == "paper" or task.robot == Quadrotor().name]


def _replays(study: Study) -> dict[str, Replay]:
    """The first flight of each kind of ends and state."""
    arena, found = study.open_arena(), {}
    for trial in trials_of(study):
        name = f"{'random' if trial.task is None else 'tasks'}_{'known' if trial.known else 'camera'}"
        found.setdefault(name, Replay(arena.scene.name, partial(record, arena, trial)))
    return found


def record(arena: Arena, trial: FlightTrial) -> Recording | None:
    """Fly a trial and record it; None where it does not begin."""
    task = find_task(arena, trial)
    problem = make_problem(arena, task, trial)
    return record_flight(arena, task, problem.robot, fly_problem(arena, problem, trial))


def record_flight(arena: Arena, task: Task, robot: Robot, flown: Sequence[NavigationStep]) -> Recording | None:
    """Recording of the time steps of a flight; None where there are none."""
    return Recording.of_flight(flown, robot, f"{arena.scene.name}, {task.name}") if flown else None


def fly(arena: Arena, trial: FlightTrial) -> Row:
    """Fly a trial: `row` of the table, and `steps`, lists of measurements at each time step."""
    task = find_task(arena, trial)
    problem = make_problem(arena, task, trial)
    known = {
        "ends": "tasks" if trial.task else "random", "task": task.name, "robot": problem.robot.name, "seed": trial.seed,
        "state": "known" if trial.known else "camera", "world": trial.world,
        "planned_steps": problem.steps,
        "start": _words(*task.start, task.start_yaw), "goal": _words(*task.goal, task.goal_yaw),
    }  # fmt: skip
    done = fly_problem(arena, problem, trial)
    steps = steps_of(done)
    return {"row": known | row_of(done, task.goal_state, steps), "steps": steps}


def steps_of(flown: Sequence[NavigationStep]) -> Row:
    """Lists over the time steps after the start: errors [m], NEES, truth inside the 95 % ellipsoid of position, robot
    holds, supervisor is TRACKING, and times [ms]."""
    errors = [errors_of(step.belief, step.truth) for step in flown[1:]]
    return {
        "position_m": [error["position_m"] for error in errors],
        "nees": [error["nees"] for error in errors],
        "inside_95": [error["inside_95"] for error in errors],
        "holds": [step.holds for step in flown[1:]],
        "tracking": [step.state is SupervisorState.TRACKING for step in flown[1:]],
        "filter_ms": [step.filter_ms for step in flown[1:]],
        "replan_ms": [step.replan_ms for step in flown[1:]],
        "step_ms": [step.filter_ms + step.replan_ms for step in flown[1:]],
    }


def row_of(flown: Sequence[NavigationStep], goal: RigidState, steps: Row) -> Row:
    """Figures of one flight; None where there are none."""
    last = flown[-1] if flown else None
    return {
        "outcome": outcome_by_truth(last, goal),
        "steps": len(steps["nees"]),
        "hits_expected": flown[0].hits_expected if flown else None,
        "collision_probability": flown[0].collision_probability if flown else None,
        "touches": sum(step.touched for step in flown),
        "final_m": None if last is None else (last.truth.position - goal.position).norm().item(),
        "position_median_m": quantile(steps["position_m"], 0.5),
        "position_p95_m": quantile(steps["position_m"], 0.95),
        "nees_mean": mean(steps["nees"]),
        "inside_95": mean(steps["inside_95"]),
        "silent": is_silent(steps["position_m"], steps["inside_95"], steps["tracking"]),
        "held": sum(steps["holds"]),
        **times_of(steps),
    }


def outcome_by_truth(last: NavigationStep | None, goal: RigidState) -> str:
    """Name the outcome of a flight by where the robot is: one that only believes to have arrived has diverged."""
    if last is None or last.outcome is None:
        return REFUSED
    away = (last.truth.position - goal.position).norm().item() > NavigateConfig.goal_tolerance_m
    outcome = EpisodeOutcome.DIVERGED if away and last.outcome is EpisodeOutcome.REACHED else last.outcome
    return outcome.name.lower()


def times_of(steps: Row) -> Row:
    """Median, 95th percentile and maximum of the times [ms] of some time steps."""
    return {
        f"{name}_{what}_ms": quantile(steps[f"{name}_ms"], share)
        for name in ("filter", "replan", "step")
        for what, share in (("p50", 0.5), ("p95", 0.95), ("max", 1.0))
    }


def mean(values: Sequence[float]) -> float | None:
    """Mean of values; None where there are none."""
    return float(np.mean(values)) if values else None


def quantile(values: Sequence[float], share: float) -> float | None:
    """Quantile of values; None where there are none."""
    return float(np.quantile(values, share)) if values else None


def _words(*numbers: float) -> str:
    """An end, as `nerfnav fly --start` takes it."""
    return " ".join(f"{number:.9g}" for number in numbers)


_OUTCOMES = (
    *(outcome.name.lower() for outcome in EpisodeOutcome if outcome is not EpisodeOutcome.STOPPED), REFUSED,
)  # fmt: skip
"""Outcomes that are counted: no one stops a trial."""
_QUANTILE_95 = 1.96
"""Of the normal distribution, both sides together."""


def wilson(count: int, total: int) -> tuple[float, float]:
    """Wilson's bounds on the probability of an event that happened `count` times of `total`."""
    if total == 0:
        return 0.0, 1.0
    share, width = count / total, _QUANTILE_95**2 / total
    middle = (share + 0.5 * width) / (1 + width)
    half = math.sqrt(width * (share * (1 - share) + 0.25 * width)) / (1 + width)
    return min(share, max(0.0, middle - half)), max(share, min(1.0, middle + half))  # rounding is not to part them


def summarize(flights: Sequence[Row]) -> Row:
    """Counts of outcomes, and errors and times over all steps of the flights by camera."""
    camera, known = _by(flights, "state", "camera"), _by(flights, "state", "known")
    kinds = {kind: _by(camera, "ends", kind) for kind in ("tasks", "random")}
    return {
        "trials": len(camera),
        **counts(camera),
        "truth_reached": counts(known)["reached"] if known else None,
        **{kind: {"trials": len(some), **_rate(some)} for kind, some in kinds.items() if some},
        **({"truth": {"trials": len(known), **counts(known)}} if known else {}),
        "silent": sum(flight["row"]["silent"] for flight in camera),
        **_errors(camera),
        **times_of({name: _all(camera, name) for name in ("filter_ms", "replan_ms", "step_ms")}),
    }


def counts(flights: Sequence[Row]) -> Row:
    """Count the flights by outcome, with the share that arrived and the number that touched something."""
    found = Counter(flight["row"]["outcome"] for flight in flights)
    return {
        **{outcome: found[outcome] for outcome in _OUTCOMES},
        **{name: value for name, value in _rate(flights).items() if name != "reached"},
        "touched": sum(flight["row"]["touches"] > 0 for flight in flights),
    }


def draw_figure(flights: Sequence[Row]) -> Figure:
    """Plot outcomes, errors of beliefs and times of steps."""
    figure, (ends, errors, times) = panels(("Share of flights that arrive", "Share of steps", "Share of steps"))
    groups = {
        f"{kind}, {state}": _by(_by(flights, "ends", kind), "state", state)
        for state in ("camera", "known")
        for kind in ("tasks", "random")
    }
    groups = {name: some for name, some in groups.items() if some}
    for index, (name, some) in enumerate(groups.items()):
        rate = _rate(some)
        share, color = rate["reached"] / len(some), COLORS[index]
        whiskers = [[share - rate["reached_low"]], [rate["reached_high"] - share]]
        ends.bar(index, share, width=0.62, color=color, alpha=0.85, yerr=whiskers, capsize=4)
        draw_distribution(errors, _all(some, "position_m") if "camera" in name else [], color, name)
        draw_distribution(times, _all(some, "step_ms"), color, name)
    ends.set(ylim=(0, 1), xticks=range(len(groups)))
    ends.set_xticklabels([name.replace(", ", "\n") for name in groups], fontsize=8)
    errors.set(xscale="log", xlabel="position error at most [m]", ylim=(0, 1))
    times.set(xscale="log", xlabel="time at most [ms]", ylim=(0, 1))
    errors.legend(frameon=False, fontsize=7)
    return figure


def _rate(flights: Sequence[Row]) -> Row:
    reached = sum(flight["row"]["outcome"] == EpisodeOutcome.REACHED.name.lower() for flight in flights)
    low, high = wilson(reached, len(flights))
    return {"reached": reached, "reached_low": low, "reached_high": high}


def _errors(flights: Sequence[Row]) -> Row:
    by_flight = [flight["row"]["nees_mean"] for flight in flights if flight["row"]["nees_mean"] is not None]
    return {
        "position_median_m": quantile(_all(flights, "position_m"), 0.5),
        "position_p95_m": quantile(_all(flights, "position_m"), 0.95),
        "nees_mean": mean(_all(flights, "nees")),
        "nees_of_flights_median": quantile(by_flight, 0.5),
        "inside_95": mean(_all(flights, "inside_95")),
    }


def _by(flights: Sequence[Row], name: str, value: str) -> list[Row]:
    return [flight for flight in flights if flight["row"][name] == value]


def _all(flights: Sequence[Row], name: str) -> list[float]:
    """Over all time steps of all flights."""
    return list(chain.from_iterable(flight["steps"][name] for flight in flights))

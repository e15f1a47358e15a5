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
from collections.abc import Iterator, Sequence
from functools import partial
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

from nerfnav.core.errors import InvalidInputError
from nerfnav.experiments.closed_loop_flight import REFUSED, FlightTrial, fly, mean, quantile, times_of
from nerfnav.experiments.figures import COLORS, panels
from nerfnav.experiments.study import ExperimentStep, Results, Row, Study, run_trials
from nerfnav.navigation import EpisodeOutcome
from nerfnav.robots import Quadrotor, load
from nerfnav.world import Task

if TYPE_CHECKING:
    import matplotlib.axes
    import matplotlib.figure


_OUTCOMES = ("reached", "collided", "diverged", "timeout", "no_plan", "too_risky", REFUSED)
_QUANTILE_95 = 1.96
"""Of the normal distribution, both sides together."""


def wilson(count: int, total: int) -> tuple[float, float]:
    """Bounds between which the probability of something lies that happened `count` times of `total`."""
    if total == 0:
        return 0.0, 1.0
    share, spread = count / total, _QUANTILE_95**2 / total
    middle = (share + 0.5 * spread) / (1 + spread)
    half = math.sqrt(spread * (share * (1 - share) + 0.25 * spread)) / (1 + spread)
    return min(share, max(0.0, middle - half)), max(share, min(1.0, middle + half))  # rounding is not to part them


def summary_of(flights: Sequence[Row]) -> Row:
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
    """How many ended how, the share that arrived, and how many touched anything."""
    found = Counter(flight["row"]["outcome"] for flight in flights)
    return {
        **{outcome: found[outcome] for outcome in _OUTCOMES},
        **{name: value for name, value in _rate(flights).items() if name != "reached"},
        "touched": sum(flight["row"]["touches"] > 0 for flight in flights),
    }


def picture(flights: Sequence[Row]) -> "matplotlib.figure.Figure":
    """How flights end, how far off beliefs are, and how long steps take."""
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
        _steps(errors, _all(some, "position_m") if "camera" in name else [], color, name)
        _steps(times, _all(some, "step_ms"), color, name)
    ends.set(ylim=(0, 1), xticks=range(len(groups)))
    ends.set_xticklabels([name.replace(", ", "\n") for name in groups], fontsize=8)
    errors.set(xscale="log", xlabel="position error at most [m]", ylim=(0, 1))
    times.set(xscale="log", xlabel="time at most [ms]", ylim=(0, 1))
    errors.legend(frameon=False, fontsize=7)
    return figure


def _steps(axes: "matplotlib.axes.Axes", values: Sequence[float], color: str, name: str) -> None:
    """Distribution function of some values."""
    if values:
        axes.step(np.sort(values), np.arange(1, len(values) + 1) / len(values), where="post", color=color, label=name)


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


_TRIALS = 100


def run(study: Study) -> Iterator[ExperimentStep]:
    """Fly, and count."""
    trials = trials_of(study)
    flights = yield from run_trials(study, "flying", fly, trials)
    rows = tuple(flight["row"] for flight in flights)
    left = [task.name for task in study.tasks if task not in tasks_of(study)]
    robot = study.flights.robot
    why = "its robot is no quadrotor" if robot is None else f"its robot moves otherwise than {load(robot).name} does"
    told = {"left_out": dict.fromkeys(left, why)} if left else {}
    yield Results(summary_of(flights) | told, rows, {"flights": partial(picture, flights)})


def trials_of(study: Study) -> list[FlightTrial]:
    """The flights, those with the state known right after those by camera."""
    flights = study.flights
    states = (False, True) if flights.truth else (False,)
    return [
        FlightTrial(_task(study, index), study.seed + index, known, flights.world, flights.risk, flights.robot)
        for index in range(study.trials or _TRIALS)
        for known in states
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

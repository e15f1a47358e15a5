"""Whole flights by Algorithm 1, by the camera alone: how many arrive, how far off beliefs are, and whether they know.

Trial k is flown with the seed S + k, between the ends of a task of the place (the tasks in turn) or random ends (at
rest anywhere, with 8 cm to spare on the mesh and free for the planner, as long as the way takes). With `truth` each
flight is flown again with the same noise and the state known. Equal seeds give equal flights; with more trials the
first ones stay.
"""

from collections.abc import Iterator
from functools import partial

from nerfnav.errors import InvalidInputError
from nerfnav.experiments.closed_loop_results import picture, summary_of
from nerfnav.experiments.study import ExperimentStep, Results, Study, run_trials
from nerfnav.experiments.whole_flight import FlightTrial, fly
from nerfnav.robots import Quadrotor
from nerfnav.world import Task

_TRIALS = 100


def run(study: Study) -> Iterator[ExperimentStep]:
    """Fly, and count."""
    trials = trials_of(study)
    flights = yield from run_trials(study, "flying", fly, trials)
    rows = tuple(flight["row"] for flight in flights)
    left = [task.name for task in study.tasks if task not in tasks_of(study)]
    told = {"left_out": dict.fromkeys(left, "its robot is no quadrotor")} if left else {}
    yield Results(summary_of(flights) | told, rows, {"flights": partial(picture, flights)})


def trials_of(study: Study) -> list[FlightTrial]:
    """The flights, those with the state known right after those by camera."""
    states = (False, True) if study.flights.truth else (False,)
    return [
        FlightTrial(_task(study, index), study.seed + index, known, study.flights.world, study.flights.risk)
        for index in range(study.trials or _TRIALS)
        for known in states
    ]


def _task(study: Study, index: int) -> Task | None:
    """The task of a trial; None: random ends."""
    ends, tasks = study.flights.ends, tasks_of(study)
    if ends == "random" or (ends == "both" and index % 2):
        return None
    if not tasks:
        raise InvalidInputError("this place has no tasks that could be flown here: ask for random ends")
    return tasks[(index // 2 if ends == "both" else index) % len(tasks)]


def tasks_of(study: Study) -> list[Task]:
    """The tasks that can be flown in the world that is asked for."""
    return [task for task in study.tasks if study.flights.world == "paper" or task.robot == Quadrotor().name]

"""Whole flights by Algorithm 1, by the camera alone: how many arrive, how far off beliefs are, and whether they know.

Trial k is flown with the seed S + k, between the ends of a task of the place (the tasks in turn) or random ends (at
rest anywhere, with 8 cm to spare on the mesh and free for the planner, as long as the way takes). With `robot` that
one flies, between random ends or those of the tasks of its kind. With `truth` each
flight is flown again with the same noise and the state known. Equal seeds give equal flights; with more trials the
first ones stay.
"""

from collections.abc import Iterator
from functools import partial

from nerfnav.core.errors import InvalidInputError
from nerfnav.experiments.closed_loop_results import picture, summary_of
from nerfnav.experiments.study import ExperimentStep, Results, Study, run_trials
from nerfnav.experiments.whole_flight import FlightTrial, fly
from nerfnav.robots import Quadrotor, load
from nerfnav.world import Task

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

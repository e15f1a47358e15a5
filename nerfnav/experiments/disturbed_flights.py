"""Trials on flights, the tasks in turn."""

from collections.abc import Callable, Generator
from dataclasses import dataclass

from nerfnav.experiments.arena import Arena
from nerfnav.experiments.study import Row, Study, TrialDone, run_trials
from nerfnav.world import Task

_TRIALS = 100


@dataclass(frozen=True)
class Trial:
    """One flight."""

    task: Task
    """From where to where."""
    seed: int
    """Of everything random in it."""


def over_flights(
    study: Study, label: str, trial: Callable[[Arena, Trial], list[Row]]
) -> Generator[TrialDone, None, list[Row]]:
    """Do a trial on as many flights as the study asks for, the tasks in turn; returns the rows of all."""
    count = study.trials or _TRIALS
    trials = [Trial(study.tasks[index % len(study.tasks)], study.seed * _TRIALS + index) for index in range(count)]
    answers = yield from run_trials(study, label, trial, trials)
    return [row for answer in answers for row in answer]

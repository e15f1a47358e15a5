"""How experiments are run: many trials, each on its own, on one core, on many, or on a cluster.

An experiment is a function that takes a Study and yields what it has done so far (TrialDone), and Results at last.
To add one: write a file here with such a function, and name it in the app's table of experiments.
"""

import importlib
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, TypeVar

import joblib
import torch
from matplotlib.figure import Figure

from nerfnav.errors import InvalidInputError, NerfnavError
from nerfnav.experiments.arena import Arena
from nerfnav.world.task import Task

Item = TypeVar("Item")
Answer = TypeVar("Answer")
Entry = TypeVar("Entry")
Row = dict[str, Any]
"""A line of an experiment's table: the same names in all lines, each with its unit."""


class MissingRayError(NerfnavError):
    """A cluster was asked for, and the library that leads to it is not there."""


@dataclass(frozen=True)
class Study:
    """What an experiment works with."""

    open_arena: Callable[[], Arena]
    """Opens the arena, once in each process; a named function, for it is sent to other processes."""
    tasks: tuple[Task, ...] = ()
    """Flights to try."""
    trials: int | None = None
    """How many trials; None: as many as the experiment needs."""
    seed: int = 0
    """Of everything random."""
    jobs: int | None = None
    """Trials at the same time; None: one, and on a cluster as many as it has cores."""
    ray: str | None = None
    """Address of a Ray cluster ("auto", "local", "ray://HOST:PORT"); None: this machine, without Ray."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for numbers that no study can have."""
        for name in ("trials", "jobs"):
            number = getattr(self, name)
            if number is not None and number < 1:
                raise InvalidInputError(f"{name} must be 1 or more, not {number}")

    def first(self, entries: Sequence[Entry], what: str) -> Sequence[Entry]:
        """As many of the entries as trials were asked for. Raises InvalidInputError where there are fewer."""
        if self.trials is not None and self.trials > len(entries):
            raise InvalidInputError(f"there are {len(entries)} {what}, so at most as many trials, not {self.trials}")
        return entries[: self.trials]


@dataclass(frozen=True)
class TrialDone:
    """How far an experiment is."""

    label: str
    """What is being done."""
    done: int
    """Trials that are done."""
    total: int
    """Of how many."""


@dataclass(frozen=True)
class Results:
    """What an experiment found."""

    summary: dict[str, Any]
    """Its numbers."""
    rows: tuple[Row, ...] = ()
    """Its table, one line for each trial."""
    figures: dict[str, Figure] = field(default_factory=dict)
    """Its pictures by name."""


ExperimentStep = TrialDone | Results


def run_trials(
    study: Study, label: str, trial: Callable[[Arena, Item], Answer], items: Sequence[Item]
) -> Generator[TrialDone, None, list[Answer]]:
    """Do a trial with every item, in any number of processes; returns the answers in the order of the items.

    `trial` and the items travel between processes: a function of a module, and plain values.
    """
    answers: list[Answer] = []
    yield TrialDone(label, 0, len(items))
    with _backend(study) as jobs:
        for answer in _answers(
            study, jobs, [joblib.delayed(_in_arena)(trial, study.open_arena, item) for item in items]
        ):
            answers.append(answer)
            yield TrialDone(label, len(answers), len(items))
    return answers


def _answers(study: Study, jobs: int, calls: Sequence[Any]) -> Iterator[Any]:
    """Do the calls, and yield each answer as soon as those before it are there too."""
    if study.ray is None:
        yield from joblib.Parallel(n_jobs=jobs, return_as="generator")(calls)
        return
    at_once = joblib.effective_n_jobs(jobs)
    for begin in range(0, len(calls), at_once):  # Ray's backend gives its answers only all together
        yield from joblib.Parallel(n_jobs=jobs)(calls[begin : begin + at_once])


def _in_arena(trial: Callable[[Arena, Item], Answer], open_arena: Callable[[], Arena], item: Item) -> Answer:
    before = torch.get_num_threads()
    torch.set_num_threads(1)  # trials are many small operations, and there are others beside this one
    try:
        return trial(open_arena(), item)
    finally:
        torch.set_num_threads(before)


@contextmanager
def _backend(study: Study) -> Iterator[int]:
    """Where trials run; yields how many at a time, -1 for as many as there are cores."""
    if study.ray is None:
        yield study.jobs or 1
        return
    try:
        ray = importlib.import_module("ray")
        importlib.import_module("ray.util.joblib").register_ray()
    except ImportError as error:
        raise MissingRayError("--ray needs Ray, which is not installed here: pip install 'nerfnav[ray]'") from error
    ray.init(address=study.ray, ignore_reinit_error=True, log_to_driver=False)
    try:
        with joblib.parallel_config(backend="ray"):
            yield study.jobs or -1
    finally:
        ray.shutdown()

"""Studies: run the trials of an experiment on one core, on many, or on a cluster.

An experiment is a function that takes a Study, yields its progress (TrialDone), and returns its Results. It happens in
an Arena, a scene with its trained field. A Journal records the answers of finished trials, so that an interrupted
experiment continues there.

To add one: write a file here with such a function, and name it in the app's table of experiments.
"""

import json
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import torch

from nerfnav.core.errors import InvalidInputError, InvalidNumberError
from nerfnav.core.extras import import_extra
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.figures import Figure
from nerfnav.experiments.flight_options import FlightOptions
from nerfnav.world import Task


@dataclass(frozen=True)
class Journal:
    """A file with a line of JSON for each trial that is done."""

    path: Path
    """The file; made with the first answer."""
    about: str
    """Other inputs of the answers: notes with other inputs are ignored."""

    def answers(self, items: Sequence[Any]) -> dict[int, Any]:
        """Recorded answers, by index of the item; an incomplete line is ignored."""
        if not self.path.exists():
            return {}
        noted = {}
        for line in self.path.read_text().splitlines():
            try:
                key, answer = json.loads(line)
            except ValueError:
                continue
            noted[key] = answer
        keys = [self._key(index, item) for index, item in enumerate(items)]
        return {index: noted[key] for index, key in enumerate(keys) if key in noted}

    def add(self, index: int, item: Any, answer: Any) -> None:
        """Note an answer: plain numbers, words, lists and tables of them."""
        with self.path.open("a") as stream:
            stream.write("\n" + json.dumps([self._key(index, item), answer]) + "\n")

    def _key(self, index: int, item: Any) -> str:
        return f"{self.about}: {index} {item!r}"


Item = TypeVar("Item")
Answer = TypeVar("Answer")
Entry = TypeVar("Entry")
Row = dict[str, Any]
"""A line of an experiment's table: the same names in all lines, each with its unit."""


@dataclass(frozen=True)
class Study:
    """Inputs of an experiment."""

    open_arena: Callable[[], Arena]
    """Opens the arena, once in each process; a named function, for it is sent to other processes."""
    tasks: tuple[Task, ...] = ()
    """Flights to try."""
    trials: int | None = None
    """Number of trials; None: the experiment's default."""
    seed: int = 0
    """Of everything random."""
    jobs: int | None = None
    """Trials at the same time; None: one, and on a cluster as many as it has cores."""
    ray: str | None = None
    """Address of a Ray cluster ("auto", "local", "ray://HOST:PORT"); None: this machine, without Ray."""
    flights: FlightOptions = field(default_factory=FlightOptions)
    """Of the experiment on whole flights."""
    journal: Journal | None = None
    """Journal of finished trials, which are not repeated; None: none."""
    beside: "tuple[Study, ...]" = ()
    """The same in further places, for experiments of more than one."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for numbers that no study can have."""
        for name in ("trials", "jobs"):
            number = getattr(self, name)
            if number is not None and number < 1:
                raise InvalidNumberError(name, "1 or more", number)

    def first(self, entries: Sequence[Entry], what: str) -> Sequence[Entry]:
        """As many of the entries as trials were asked for. Raises InvalidInputError where there are fewer."""
        if self.trials is not None and self.trials > len(entries):
            raise InvalidInputError(f"there are {len(entries)} {what}, so at most as many trials, not {self.trials}")
        return entries[: self.trials]


@dataclass(frozen=True)
class TrialDone:
    """Progress of an experiment."""

    label: str
    """Current task."""
    done: int
    """Trials that are done."""
    total: int
    """Of how many."""


@dataclass(frozen=True)
class Results:
    """Results of an experiment."""

    summary: dict[str, Any]
    """Its numbers."""
    rows: tuple[Row, ...] = ()
    """Its table, one line for each trial."""
    figures: dict[str, Callable[[], Figure]] = field(default_factory=dict)
    """Functions that draw the figures, by name; they raise MissingExtraError without matplotlib."""


ExperimentSteps = Generator[TrialDone, bool | None, Results]
"""Experiment in progress: yields its progress and returns its results; what is sent to it is ignored."""


def run_trials(
    study: Study, label: str, trial: Callable[[Arena, Item], Answer], items: Sequence[Item]
) -> Generator[TrialDone, bool | None, list[Answer]]:
    """Do a trial with every item, in any number of processes; returns the answers in the order of the items.

    `trial` and the items travel between processes: a function of a module, and plain values. With a journal the
    answers must be plain values too, and come back as JSON has them.
    """
    journal = None if study.journal is None else replace(study.journal, about=f"{study.journal.about}, {label}")
    answers: dict[int, Answer] = {} if journal is None else journal.answers(items)
    yield TrialDone(label, len(answers), len(items))
    left = [index for index in range(len(items)) if index not in answers]
    calls = [partial(_in_arena, trial, study.open_arena, items[index]) for index in left]
    for index, answer in zip(left, _answers(study, calls), strict=True):
        answers[index] = answer
        if journal is not None:
            journal.add(index, items[index], answer)
        yield TrialDone(label, len(answers), len(items))
    return [answers[index] for index in range(len(items))]


def _answers(study: Study, calls: Sequence[Callable[[], Any]]) -> Iterator[Any]:
    """Do the calls, and yield each answer as soon as those before it are there too."""
    if study.ray is not None:
        yield from _on_cluster(study.ray, study.jobs or -1, calls)
    elif study.jobs is None or study.jobs == 1:
        yield from (call() for call in calls)
    else:
        joblib = import_extra("joblib", "experiments", "more than one trial at the same time")
        yield from joblib.Parallel(n_jobs=study.jobs, return_as="generator")(joblib.delayed(call)() for call in calls)


def _on_cluster(address: str, jobs: int, calls: Sequence[Callable[[], Any]]) -> Iterator[Any]:
    """The same on a Ray cluster, `jobs` at a time, -1 for as many as it has cores."""
    ray, joblib = (import_extra(name, "ray", "--ray") for name in ("ray", "joblib"))
    import_extra("ray.util.joblib", "ray", "--ray").register_ray()
    ray.init(address=address, ignore_reinit_error=True, log_to_driver=False)
    try:
        with joblib.parallel_config(backend="ray"):
            at_once = joblib.effective_n_jobs(jobs)
            for begin in range(0, len(calls), at_once):  # Ray's backend gives its answers only all together
                some = calls[begin : begin + at_once]
                yield from joblib.Parallel(n_jobs=jobs)(joblib.delayed(call)() for call in some)
    finally:
        ray.shutdown()


def _in_arena(trial: Callable[[Arena, Item], Answer], open_arena: Callable[[], Arena], item: Item) -> Answer:
    before = torch.get_num_threads()
    torch.set_num_threads(1)  # trials are many small operations, and there are others beside this one
    try:
        return trial(open_arena(), item)
    finally:
        torch.set_num_threads(before)

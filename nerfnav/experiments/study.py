"""Studies: run the trials of an experiment on one core, on many, or on a cluster.

An experiment is a function that takes a Study, yields its progress (TrialDone), and returns its Results. It happens in
an Arena, a scene with its trained field. A Journal records the trials that have ended, so that an interrupted
experiment continues there. A trial that raises an error has failed: it is recorded with its reason, and the others go
on.

To add one: write a file here with such a function, and name it in the app's table of experiments.
"""

import json
import multiprocessing
import signal
import sys
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache, partial
from itertools import islice
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import torch

from nerfnav.core.errors import (
    InvalidInputError,
    InvalidNumberError,
    MissingExtraError,
    NerfnavError,
    first_line,
    require_seed,
)
from nerfnav.core.extras import import_extra
from nerfnav.core.jit import threads
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.figures import Figure
from nerfnav.experiments.flight_options import FlightOptions
from nerfnav.export import Recording
from nerfnav.formats import convert_record, parse_json
from nerfnav.world import Task


class TrialEnd(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Line of results.jsonl: a trial that has ended."""

    place: str
    """Place of the trial."""
    setting: str
    """Settings of a sweep, such as risk-weight=3; empty without one."""
    work: str
    """Label of the series that the trial belongs to."""
    trial: int
    """Index in that series, from 0."""
    seed: int
    """Seed of everything random in it."""
    wall_s: float
    """Wall-clock time [s]."""
    cpu_s: float
    """CPU time of its process [s]."""
    failed: str | None = None
    """Reason of a failure; None: it has an answer."""
    answer: Any = None
    """Answer of the trial, as JSON has it."""


@dataclass(frozen=True)
class Journal:
    """File of JSON lines to which each trial is appended as it ends; one file for all series of an experiment."""

    path: Path
    """The file; made with the first line."""
    place: str = ""
    """Place of the trials that are read and added."""
    setting: str = ""
    """Settings of their sweep."""

    def drop_cut_line(self) -> bool:
        """Remove an incomplete last line, which an interrupted process leaves. Return True where there was one."""
        if not self.path.exists():
            return False
        data = self.path.read_bytes()
        whole = data.rfind(b"\n") + 1
        if whole == len(data):
            return False
        with self.path.open("r+b") as stream:
            stream.truncate(whole)
        return True

    def ends(self, work: str) -> dict[int, TrialEnd]:
        """Read the trials of a series that have ended, by index. Raises InvalidInputError for a damaged line."""
        if not self.path.exists():
            return {}
        found = {}
        for number, line in enumerate(self.path.read_bytes().splitlines(), 1):
            where = f"{self.path}, line {number},"
            end = convert_record(parse_json(line.decode(errors="replace"), where), TrialEnd, where)
            if (end.place, end.setting, end.work) == (self.place, self.setting, work):
                found[end.trial] = end
        return found

    def add(self, end: TrialEnd) -> TrialEnd:
        """Append a trial, and return it as it will be read. Raises OSError where it cannot be written."""
        line = json.dumps(msgspec.structs.asdict(end)) + "\n"
        with self.path.open("a") as stream:
            stream.write(line)
        return convert_record(json.loads(line), TrialEnd, self.path)


Item = TypeVar("Item")
Answer = TypeVar("Answer")
Entry = TypeVar("Entry")
Row = dict[str, Any]
"""A line of an experiment's table: the same names in all lines, each with its unit."""


def require_numbers(trials: int | None, jobs: int | None, seed: int) -> None:
    """Raise InvalidNumberError for numbers of trials or jobs below 1, and for what is no seed."""
    for name, number in {"trials": trials, "jobs": jobs}.items():
        if number is not None and number < 1:
            raise InvalidNumberError(name, "1 or more", number)
    require_seed(seed=seed)


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
        """Raise InvalidNumberError for numbers that no study can have."""
        require_numbers(self.trials, self.jobs, self.seed)

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
    ended: tuple[TrialEnd, ...] = ()
    """Trials that have ended since the report before."""


@dataclass(frozen=True)
class Replay:
    """Flight of an experiment that can be watched."""

    place: str
    """Name of its scene."""
    record: Callable[[], Recording | None]
    """Flies it again by its seed; None where it does not begin."""


@dataclass(frozen=True)
class Results:
    """Results of an experiment."""

    summary: dict[str, Any]
    """Its numbers."""
    rows: tuple[Row, ...] = ()
    """Its table, one line for each trial."""
    figures: dict[str, Callable[[], Figure]] = field(default_factory=dict)
    """Functions that draw the figures, by name; they raise MissingExtraError without matplotlib."""
    by: tuple[str, ...] = ()
    """Columns of the table whose values make the groups that medians and percentiles are taken over."""
    sample: tuple[Row, ...] | None = None
    """Lines that they are taken over; None: all of the table."""
    replays: dict[str, Replay] = field(default_factory=dict)
    """One flight of each kind, by name."""


ExperimentSteps = Generator[TrialDone, bool | None, Results]
"""Experiment in progress: yields its progress and returns its results; what is sent to it is ignored."""


def run_trials(
    study: Study, label: str, trial: Callable[[Arena, Item], Answer], items: Sequence[Item]
) -> Generator[TrialDone, bool | None, list[Answer]]:
    """Do a trial with every item, in any number of processes; return the answers of those that did not fail, in the
    order of the items.

    `trial` and the items travel between processes: a function of a module, and plain values. With a journal the
    answers must be plain values too, and come back as JSON has them. Raises NerfnavError where a trial lacks an
    optional dependency or its process is killed, OSError where the journal cannot be written.
    """
    journal = study.journal
    ends = {} if journal is None else journal.ends(label)
    yield TrialDone(label, len(ends), len(items), tuple(ends.values()))
    left = [index for index in range(len(items)) if index not in ends]
    known = TrialEnd("", "", label, 0, study.seed, 0.0, 0.0)
    if journal is not None:
        known = msgspec.structs.replace(known, place=journal.place, setting=journal.setting)
    for found in _ended(study, trial, items, left):
        if found.lacks:
            raise NerfnavError(str(found.failed))
        end = msgspec.structs.replace(
            known, trial=found.index, seed=getattr(items[found.index], "seed", study.seed), wall_s=found.wall_s,
            cpu_s=found.cpu_s, failed=found.failed, answer=found.answer,
        )  # fmt: skip
        ends[found.index] = end if journal is None else journal.add(end)
        yield TrialDone(label, len(ends), len(items), (ends[found.index],))
    return [ends[index].answer for index in range(len(items)) if ends[index].failed is None]


@dataclass(frozen=True)
class _Ended:
    """Call of a trial that has ended; it travels between processes, where errors do not."""

    index: int
    answer: Any
    failed: str | None
    lacks: bool
    """It lacks an optional dependency, as all others will."""
    wall_s: float
    cpu_s: float


def _ended(
    study: Study, trial: Callable[[Arena, Item], Answer], items: Sequence[Item], left: Sequence[int]
) -> Iterator[_Ended]:
    """Do a trial with the items of those indices, and yield each end as soon as it is there."""
    do = partial(_in_arena, trial, study.open_arena)
    if study.ray is not None and left:
        yield from _on_cluster(study, trial, items, left)
    elif study.jobs is None or study.jobs == 1:
        yield from (do(index, items[index]) for index in left)
    elif left:
        study.open_arena()  # before the processes fork, which then have it
        yield from _in_processes(study.jobs, do, items, left)


_START = "fork" if sys.platform == "linux" else "spawn"
"""A fork has the modules, the arena and the kernels of this process at once; spawned ones load them for 4 s each."""


def _in_processes(
    count: int, do: Callable[[int, Item], _Ended], items: Sequence[Item], left: Sequence[int]
) -> Iterator[_Ended]:
    """The same in `count` processes of this machine. Raises NerfnavError where one of them dies."""
    context, waiting = multiprocessing.get_context(_START), iter(left)
    workers: dict[Connection, Any] = {}
    try:
        for index in islice(waiting, count):
            here, there = context.Pipe()
            worker = context.Process(target=_serve, args=(here, there, do, items), daemon=True)
            worker.start()
            workers[here] = worker
            there.close()
            here.send(index)
        while workers:
            ready = wait([*workers])
            for here in [pipe for pipe in workers if pipe in ready]:
                try:
                    ended = here.recv()
                    here.send(index := next(waiting, None))
                except (EOFError, ConnectionError) as error:
                    raise NerfnavError(
                        "a process of the trials was killed, perhaps for lack of memory: the same command goes on "
                        "with the trials that are missing, and needs less memory with fewer jobs"
                    ) from error
                if index is None:
                    workers.pop(here).join()
                yield ended
    finally:
        for worker in workers.values():
            worker.terminate()
            worker.join()


def _serve(here: Connection, there: Connection, do: Callable[[int, Item], _Ended], items: Sequence[Item]) -> None:
    """Do the trials whose indices arrive, until None does or the other process ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that started it, which ends this one
    here.close()  # of the other process: its copy here would keep the pipe open
    try:
        while (index := there.recv()) is not None:
            there.send(do(index, items[index]))
    except (EOFError, ConnectionError):
        return


def _on_cluster(
    study: Study, trial: Callable[[Arena, Item], Answer], items: Sequence[Item], left: Sequence[int]
) -> Iterator[_Ended]:
    """The same on a Ray cluster, `jobs` at a time, by default as many as it has cores.

    The arena goes into the object store once. Trials of a node that is lost are done again on another one.
    """
    ray = import_extra("ray", "ray", "--ray")
    ray.init(address=study.ray, ignore_reinit_error=True, log_to_driver=False)
    try:
        do = ray.remote(num_cpus=1, max_retries=-1)(_in_arena)
        open_arena = _Shared(ray.put(study.open_arena()))
        calls = (do.remote(trial, open_arena, index, items[index]) for index in left)
        running = list(islice(calls, study.jobs or len(left)))
        while running:
            ended, running = ray.wait(running)
            running += islice(calls, len(ended))
            yield from ray.get(ended)
    finally:
        ray.shutdown()


@dataclass(frozen=True)
class _Shared:
    """Function that gets an arena from Ray's object store, once in each process."""

    reference: Any

    def __call__(self) -> Arena:
        """The arena."""
        return _arena_of(self.reference)


@lru_cache(maxsize=4)
def _arena_of(reference: Any) -> Arena:
    return import_extra("ray", "ray", "--ray").get(reference)


def _in_arena(
    trial: Callable[[Arena, Item], Answer], open_arena: Callable[[], Arena], index: int, item: Item
) -> _Ended:
    """Do one trial. Any error is its failure: a series of hours does not end with one of its trials."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)  # trials are many small operations, and sums depend on the number of threads
    wall, cpu = time.perf_counter(), time.process_time()
    answer, failed, lacks = None, None, False
    try:
        with threads(1):  # a pool of threads does not outlive a fork, and each process has one core
            answer = trial(open_arena(), item)
    except NerfnavError as error:
        failed, lacks = str(error), isinstance(error, MissingExtraError)
    except Exception as error:
        failed = f"{type(error).__name__}: {first_line(error)}"
    finally:
        torch.set_num_threads(before)
    return _Ended(index, answer, failed, lacks, time.perf_counter() - wall, time.process_time() - cpu)

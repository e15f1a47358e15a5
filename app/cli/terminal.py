"""What a terminal shows of a command: a progress bar on stderr while it works, its numbers on stdout when done."""

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import singledispatch
from types import FrameType
from typing import Any

import torch
from rich.console import Console
from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bars
from rich.table import Table

from app.jobs.events import JobEvents, JobResult, Progress
from app.storage.output_files import json_line
from app.system.threads import TORCH_THREADS
from nerfnav.field.train import TrainStep
from nerfnav.navigation.steps import NavigationStep
from nerfnav.planner.steps import PlanStep

_UNITS = {"m": "m", "s": "s", "ms": "ms", "db": "dB", "rad": "rad", "n": "N", "m3": "m³", "bytes": "bytes"}


def follow(job: JobEvents, can_stop_early: bool = False) -> JobResult:
    """Run a job to its end behind a progress bar, and return what it returns.

    With `can_stop_early` the first Ctrl-C asks the job to end and keep what it has; a second one ends it at once.
    """
    torch.set_num_threads(TORCH_THREADS)
    answer: bool | None = None
    with _bar() as (bars, task), _stop_on_interrupt(can_stop_early) as stop:
        while True:
            try:
                event = job.send(answer)
            except StopIteration as end:
                return end.value
            if isinstance(event, Progress):
                bars.update(task, description=event.label, completed=event.fraction)
            elif told := tell(event):
                bars.update(task, told=told)
            answer = stop.asked or None


def show(title: str, summary: dict[str, Any], as_json: bool) -> None:
    """Print a command's numbers: one line of JSON, or a table for people."""
    if as_json:
        sys.stdout.write(json_line(summary) + "\n")
        return
    table = Table(title=title, title_justify="left", show_header=False, box=None, pad_edge=False)
    for name, value in _flat(summary):
        table.add_row(*_row(name, value))
    Console().print(table)


def note(sentence: str) -> None:
    """Tell the user something that is no result."""
    sys.stderr.write(sentence + "\n")


@singledispatch
def tell(event: object) -> str:
    """What a progress bar says of an event besides its fraction; empty for most events."""
    return ""


@tell.register
def _(event: PlanStep) -> str:
    return f"iteration {event.iteration + 1}, J = {event.cost.total:.4g}"


@tell.register
def _(event: TrainStep) -> str:
    speed = f"{event.rays_per_s / 1e3:.0f} k rays/s"
    return f"PSNR {event.psnr_db:.1f} dB, {speed}, {event.seconds_left:.0f} s left"


@tell.register
def _(event: NavigationStep) -> str:
    error = (event.truth.position - event.belief.mean.position).norm().item()
    return f"step {event.index}, {event.time:.1f} s, believed position off by {100 * error:.1f} cm"


@contextmanager
def _bar() -> Iterator[tuple[Bars, Any]]:
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.fields[told]}"),
    )
    console = Console(stderr=True)
    with Bars(*columns, console=console, transient=True, disable=not console.is_terminal) as bars:
        yield bars, bars.add_task("starting", total=1.0, told="")


class _Stop:
    asked = False


@contextmanager
def _stop_on_interrupt(enabled: bool) -> Iterator[_Stop]:
    """Turn the first Ctrl-C inside the block into `asked`; the second one interrupts as usual."""
    stop = _Stop()
    if not enabled:
        yield stop
        return

    def ask(_signal: int, _frame: FrameType | None) -> None:
        stop.asked = True
        signal.signal(signal.SIGINT, before)
        note("stopping, and keeping what was done so far (Ctrl-C again gives it up)")

    before = signal.signal(signal.SIGINT, ask)
    try:
        yield stop
    finally:
        signal.signal(signal.SIGINT, before)


def _flat(summary: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in summary.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{prefix}{name} ")
        else:
            yield prefix + name, value


def _row(name: str, value: Any) -> tuple[str, str]:
    """A label and a number with its unit, read from the name's ending: `wall_s` is `wall`, in s."""
    label, _, ending = name.rpartition("_")
    unit = _UNITS.get(ending) if label else None
    text = _text(value)
    if unit is None:
        return name.replace("_", " "), text
    return label.replace("_", " "), f"{text} {unit}" if value is not None else text


def _text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list | tuple):
        return ", ".join(_text(entry) for entry in value)
    if value is None:
        return "none"
    return ("no", "yes")[value] if isinstance(value, bool) else str(value)

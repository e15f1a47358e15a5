"""Progress bar on stderr while a job works."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import torch
from rich.console import Console
from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bars

from app.cli.event_words import tell
from app.cli.interrupts import stop_on_interrupt
from app.jobs.events import JobEvents, JobResult, Progress
from app.system.threads import TORCH_THREADS


def follow(job: JobEvents, can_stop_early: bool = False) -> JobResult:
    """Run a job to its end behind a progress bar, and return what it returns.

    With `can_stop_early` the first Ctrl-C asks the job to end and keep what it has; a second one ends it at once.
    """
    torch.set_num_threads(TORCH_THREADS)
    answer: bool | None = None
    with _bar() as (bars, task), stop_on_interrupt(can_stop_early) as stop:
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

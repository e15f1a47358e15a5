"""Progress bar on stderr while a job works, and what Ctrl-C does to it."""

import signal
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager

import rich.progress
import torch
from rich.console import Console

from nerfnav.core.jit import report_compilation
from nerfnav.field import TrainStep
from nerfnav.navigation import NavigationStep
from nerfnav.planner import PlanStep
from nerfnav_app.cli.terminal import note, show
from nerfnav_app.jobs.events import COMPILING, JobEvents, JobResult, Progress, Remark
from nerfnav_app.system import TORCH_THREADS


def run_and_print(title: str, job: JobEvents, as_json: bool, can_stop_early: bool = False) -> JobResult:
    """Follow a job to its end, print its numbers under a title, and return what it returns."""
    result = run_with_progress(job, can_stop_early)
    show(title, result.summary, as_json)
    return result


def run_with_progress(job: JobEvents, can_stop_early: bool = False) -> JobResult:
    """Run a job to its end behind a progress bar, and return what it returns.

    With `can_stop_early` the first Ctrl-C asks the job to end and keep what it has; a second one ends it at once.
    """
    torch.set_num_threads(TORCH_THREADS)
    answer: bool | None = None
    with _bar() as (bars, task), _stop_on_interrupt(can_stop_early) as stop:
        while True:
            try:
                with _show_compilation(bars, task):
                    event = job.send(answer)
            except StopIteration as end:
                return end.value
            if isinstance(event, Progress):
                bars.update(task, description=event.label, completed=event.fraction)
            elif isinstance(event, Remark):
                note(event.sentence)
            elif details := _details_of(event):
                bars.update(task, details=details)
            answer = stop.asked or None


@contextmanager
def _bar() -> Iterator[tuple[rich.progress.Progress, rich.progress.TaskID]]:
    columns = (
        rich.progress.TextColumn("{task.description}"),
        rich.progress.BarColumn(),
        rich.progress.TaskProgressColumn(),
        rich.progress.TimeElapsedColumn(),
        rich.progress.TextColumn("{task.fields[details]}"),
    )
    console = Console(stderr=True)
    with rich.progress.Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bars:
        yield bars, bars.add_task("starting", total=1.0, details="")


def _show_compilation(bars: rich.progress.Progress, task: rich.progress.TaskID) -> AbstractContextManager[None]:
    """Show inside the block when the compiler works."""
    before = bars.tasks[0].description
    return report_compilation(lambda begins: bars.update(task, description=COMPILING if begins else before))


def _details_of(event: object) -> str:
    """Text of a progress bar for an event, beside its fraction; empty for most events."""
    match event:
        case PlanStep():
            return f"iteration {event.iteration + 1}, J = {event.cost.total:.4g}"
        case TrainStep():
            speed = f"{event.rays_per_s / 1e3:.0f} k rays/s"
            return f"PSNR {event.psnr_db:.1f} dB, {speed}, {event.seconds_left:.0f} s left"
        case NavigationStep():
            error = (event.truth.position - event.belief.mean.position).norm().item()
            return f"step {event.index}, {event.time:.1f} s, believed position off by {100 * error:.1f} cm"
    return ""


class _Stop:
    asked = False
    """Whether Ctrl-C was pressed."""


@contextmanager
def _stop_on_interrupt(enabled: bool) -> Iterator[_Stop]:
    """Turn the first Ctrl-C inside the block into `asked`; the second one interrupts as usual."""
    stop = _Stop()
    if not enabled:
        yield stop
        return

    def ask(*_signal_and_frame: object) -> None:
        stop.asked = True
        signal.signal(signal.SIGINT, before)
        note("stopping, and keeping what was done so far (Ctrl-C again gives it up)")

    before = signal.signal(signal.SIGINT, ask)
    try:
        yield stop
    finally:
        signal.signal(signal.SIGINT, before)

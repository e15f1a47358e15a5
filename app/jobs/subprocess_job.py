"""A job in a process of its own: it can be stopped in the middle of a long step, and leaves no memory behind."""

import multiprocessing
import signal
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection

from nerfnav.core.errors import NerfnavError
from nerfnav_app.jobs.events import JobEvent, JobEvents, JobResult, JobRun, Progress

_BEAT_S = 0.25


@dataclass(frozen=True)
class _Refused:
    """The job raised NerfnavError, whose classes do not all travel between processes."""

    message: str


def run_in_subprocess(job: Callable[[], JobEvents]) -> JobEvents:
    """Yield the events of a job, and its progress four times a second; return its result. Closing ends the process.

    `job` travels to the process: a function of a module, with plain values. Raises NerfnavError where the job does, or
    where the process ends before the job.
    """
    context = multiprocessing.get_context("spawn")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_send_events, args=(job, sender), daemon=True)
    process.start()
    sender.close()
    reached = Progress("starting a process for it", 0.0)
    try:
        while not isinstance(event := _received(receiver) if receiver.poll(_BEAT_S) else reached, JobResult):
            reached = event if isinstance(event, Progress) else reached
            yield event
        return event
    finally:
        process.terminate()
        process.join()
        receiver.close()


def _received(receiver: Connection) -> JobEvent | JobResult:
    try:
        message = receiver.recv()
    except EOFError as error:
        raise NerfnavError("the process of this job ended before it was done, and the log says more") from error
    if isinstance(message, _Refused):
        raise NerfnavError(message.message)
    return message


def _send_events(job: Callable[[], JobEvents], sender: Connection) -> None:
    """Do the job and send what it yields and returns. Runs in the process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for who started it, who then ends this process
    with suppress(BrokenPipeError):
        try:
            running = JobRun(job())
            for event in running:
                sender.send(event)
            sender.send(running.result)
        except NerfnavError as error:
            sender.send(_Refused(str(error)))

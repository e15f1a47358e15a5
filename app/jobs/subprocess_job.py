"""A job in a process of its own: it can be stopped in the middle of a long step, and leaves no memory behind."""

import multiprocessing
import signal
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection

from app.jobs.events import JobEvent, JobEvents, JobFailed, JobFinished, Progress
from nerfnav.errors import NerfnavError

_BEAT_S = 0.25


def in_subprocess(job: Callable[[], JobEvents]) -> JobEvents:
    """Yield what a job yields, and four times a second how far it is; closing ends the process.

    `job` travels to the process: a function of a module, with plain values. Raises NerfnavError where the process ends
    before the job.
    """
    context = multiprocessing.get_context("spawn")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_tell, args=(job, sender), daemon=True)
    process.start()
    sender.close()
    event: JobEvent = Progress("starting a process for it", 0.0)
    reached = event
    try:
        while not isinstance(event, JobFinished | JobFailed):
            event = _next_event(receiver) if receiver.poll(_BEAT_S) else reached
            reached = event if isinstance(event, Progress) else reached
            yield event
    finally:
        process.terminate()
        process.join()
        receiver.close()


def _next_event(receiver: Connection) -> JobEvent:
    try:
        return receiver.recv()
    except EOFError as error:
        raise NerfnavError("the process of this job ended before it was done, and the log says more") from error


def _tell(job: Callable[[], JobEvents], sender: Connection) -> None:
    """Do the job and send what it yields. Runs in the process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for who started it, who then ends this process
    with suppress(BrokenPipeError):
        try:
            for event in job():
                sender.send(event)
        except NerfnavError as error:
            sender.send(JobFailed("", str(error)))

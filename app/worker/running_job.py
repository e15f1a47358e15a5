"""A job in progress, step by step at its pace."""

import logging
import time
from collections.abc import Callable
from typing import Any

from nerfnav.core.errors import NerfnavError
from nerfnav.core.jit import report_compilation
from nerfnav.importers import StrayPartsError
from nerfnav.navigation import Iteration, NavigationStep
from nerfnav_app.jobs.events import COMPILING, JobEvents, JobFailed, JobFinished, Progress
from nerfnav_app.state.job import Job
from nerfnav_app.state.session import Session
from nerfnav_app.worker.work import Work

_log = logging.getLogger(__name__)
_ITERATION_S = 1 / 20  # in a flight, the page does not show iterations that follow the last report sooner


class RunningJob:
    """Job in progress, with its pace."""

    def __init__(self, job: Job, work: Work, session: Session) -> None:
        self.id = job.id
        self._reached = Progress("", 0.0)
        self._name = job.kind.value
        self._ended = False
        self._time_steps, self._reported_at = 0, 0.0
        self._step_s, self._step_began, self._begun_at = 0.0, 0.0, 0.0
        self._between_steps = True
        self._events = self._begin(job, work, session)

    @staticmethod
    def _begin(job: Job, work: Work, session: Session) -> JobEvents:
        return (yield from work.begin(session, job))

    def may_go_on(self, job: Job) -> bool:
        """Check whether there is a next step, and the job is not held before it."""
        held = job.paused and self._time_steps >= job.allowed_steps
        return not self._ended and not held and self.rest_s(job) == 0

    def rest_s(self, job: Job) -> float:
        """Compute the wait before the next time step, so that a flight is not faster than its pace [s]."""
        if job.pace <= 0 or self._time_steps == 0:
            return 0.0
        return max(0.0, self._step_began + self._step_s / job.pace - time.monotonic())

    def next_event(self, meanwhile: Callable[[Progress], None]) -> Any:
        """Advance the job to its next event; its end, with its result, and its failures are events too.

        `meanwhile` gets a progress where the job waits for the compiler, which takes a minute, and where it goes on.
        Iterations of filter and planner that follow each other faster than the page changes are skipped once a flight
        is under way: a report of each would take the interpreter from the next one.
        """

        def report(compiles: bool) -> None:
            meanwhile(Progress(COMPILING, self._reached.fraction) if compiles else self._reached)

        if self._between_steps:
            self._begun_at, self._between_steps = time.monotonic(), False
        try:
            with report_compilation(report):
                event = next(self._events)
                while self._is_too_soon(event):
                    event = next(self._events)
        except StopIteration as end:
            event = JobFinished(self._name, end.value)
        except StrayPartsError as error:
            event = JobFailed(self._name, error.finding, error.without)
        except NerfnavError as error:
            event = JobFailed(self._name, str(error))
        except Exception as error:
            _log.exception("the job %s broke", self._name)
            event = JobFailed(self._name, describe_fault(error))
        self._reported_at = time.monotonic()
        self._reached = event if isinstance(event, Progress) else self._reached
        self._ended = isinstance(event, JobFailed | JobFinished)
        if isinstance(event, NavigationStep):
            self._time_steps += 1
            self._step_s, self._step_began, self._between_steps = event.plan.dt, self._begun_at, True
        return event

    def _is_too_soon(self, event: Any) -> bool:
        """Check whether it is an iteration within a time step, too soon after the last report to be shown."""
        within = self._time_steps > 0 and isinstance(event, Iteration)
        return within and time.monotonic() < self._reported_at + _ITERATION_S

    def close(self) -> None:
        """Cancel the rest of the job."""
        self._events.close()


def describe_fault(error: Exception) -> str:
    return f"This is a fault of the program ({type(error).__name__}: {error}); it goes on, and the log says more."

"""The one thread that computes: it does what the session wants, and nothing else.

The session is not told what to do step by step: `follow` hands over the latest session, and between two steps of a
job the worker looks at it. A job that is no longer wanted is closed, a paused one is held, queries of the page are
answered between steps; of two wishes the later wins.
"""

import logging
import threading
import time
from collections.abc import Callable
from typing import Any, Protocol

import torch

from app.jobs.events import JobEvents, JobFailed, JobFinished
from app.places.place import Place
from app.queries.catalog import pending_queries
from app.queries.query import Query
from app.state.actions import QueryAnswered, Reported, RunChanged, Tell
from app.state.runs import RunChange
from app.state.session import Job, Session
from app.system.memory import give_back
from nerfnav.errors import NerfnavError
from nerfnav.navigation.steps import NavigationStep

_log = logging.getLogger(__name__)
_ANSWER_EVERY_S = 0.1  # pause between two answers while a job runs, which has the rest of the time
_GIVE_BACK_EVERY_S = 10.0  # while a job runs, and after each


Posted = Reported | QueryAnswered | RunChanged | Tell
"""What the worker tells the session."""


class Work(Protocol):
    """What the worker can do."""

    def begin(self, session: Session, job: Job) -> JobEvents:
        """The events of a job, computed as they are asked for."""
        ...

    def answer(self, place: Place, query: Query[Any]) -> Any:
        """The result of a query of the page."""
        ...

    def change(self, change: RunChange) -> RunChanged:
        """Rename or delete a stored run."""
        ...

    def follow(self, session: Session) -> None:
        """Let the running job know of the session as it is now."""
        ...


class Worker:
    """Runs the wanted job on a thread of its own and posts what it yields."""

    def __init__(self, work: Work, post: Callable[[Posted], None], threads: int) -> None:
        """`post` takes messages for the session from this thread; `threads` is how many torch may use."""
        self._work, self._post, self._threads = work, post, threads
        self._changed = threading.Condition()
        self._wanted: Session | None = None
        self._stopping = False
        self._running: _Running | None = None
        self._answered: set[Query[Any]] = set()
        self._changed_runs: set[int] = set()
        self._last_answer = 0.0
        self._gave_back = time.monotonic()
        self._thread = threading.Thread(target=self._run, name="nerfnav-worker", daemon=True)

    def start(self) -> None:
        """Begin to follow."""
        self._thread.start()

    def follow(self, session: Session) -> None:
        """From now on, do what `session` wants."""
        with self._changed:
            self._wanted = session
            self._answered.intersection_update(pending_queries(session))
            self._changed.notify()

    def stop(self, timeout_s: float = 10.0) -> None:
        """Close the running job and end the thread, waiting at most `timeout_s` for the step in progress."""
        with self._changed:
            self._stopping = True
            self._changed.notify()
        self._thread.join(timeout_s)

    def _run(self) -> None:
        while (session := self._next_session()) is not None:
            # again and again, for a parallel kernel of numba leaves torch in this thread with all cores
            torch.set_num_threads(self._threads)
            self._switch(session)
            self._change_runs(session)
            self._answer_one()
            self._advance(session)
            if time.monotonic() - self._gave_back > _GIVE_BACK_EVERY_S:
                self._give_back()
        if self._running is not None:
            self._running.close()

    def _next_session(self) -> Session | None:
        """The session to serve, as soon as there is something to do for it; None when it is time to end."""
        with self._changed:
            while not self._stopping:
                if self._wanted is not None and self._has_work(self._wanted):
                    return self._wanted
                self._changed.wait(self._rest_s(self._wanted))
            return None

    def _rest_s(self, session: Session | None) -> float | None:
        """How long there is nothing to do unless the session changes [s]; None where that is for good."""
        if self._running is None or session is None or session.job is None:
            return None
        return self._running.rest_s(session.job) or None

    def _has_work(self, session: Session) -> bool:
        running, job = self._running, session.job
        if (running is None) != (job is None) or self._open_query(session) or self._open_changes(session):
            return True
        return running is not None and job is not None and (running.id != job.id or running.may_go_on(job))

    def _switch(self, session: Session) -> None:
        """Close the running job if another is wanted or none, and begin the wanted one."""
        job = session.job
        if self._running is not None and (job is None or job.id != self._running.id):
            self._running.close()
            self._running = None
            self._give_back()
        if job is not None and self._running is None:
            self._running = _Running(job, self._work, session)

    def _open_query(self, session: Session) -> Query[Any] | None:
        """A query that is not answered yet; while a job runs, not too soon after the last one."""
        busy = self._running is not None and session.job is not None and self._running.may_go_on(session.job)
        if busy and time.monotonic() - self._last_answer < _ANSWER_EVERY_S:
            return None
        return next((query for query in pending_queries(session) if query not in self._answered), None)

    def _answer_one(self) -> None:
        with self._changed:
            # of the latest session: an older one may still ask what was answered a moment ago
            session = self._wanted
            query = self._open_query(session) if session is not None else None
            if session is None or session.place is None or query is None:
                return
            self._answered.add(query)
        try:
            self._post(QueryAnswered(query, self._work.answer(session.place, query)))
        except NerfnavError as error:
            self._post(Tell("No answer", str(error), bad=True))
        except Exception as error:
            _log.exception("answering %s failed", type(query).__name__)
            self._post(Tell("Something broke", _describe(error), bad=True))
        self._last_answer = time.monotonic()

    def _open_changes(self, session: Session) -> list[RunChange]:
        """Changes of stored runs that are not made yet; each is made once."""
        return [change for change in session.runs.changes if change.id not in self._changed_runs]

    def _change_runs(self, session: Session) -> None:
        for change in self._open_changes(session):
            self._changed_runs.add(change.id)
            self._post(self._work.change(change))

    def _give_back(self) -> None:
        give_back()
        self._gave_back = time.monotonic()

    def _advance(self, session: Session) -> None:
        running, job = self._running, session.job
        if running is not None and job is not None and running.may_go_on(job):
            self._work.follow(session)
            self._post(Reported(running.id, running.next_event()))


class _Running:
    """A job in progress."""

    def __init__(self, job: Job, work: Work, session: Session) -> None:
        self.id = job.id
        self._name = job.kind.value
        self._ended = False
        self._time_steps = 0
        self._step_s, self._step_began, self._begun_at = 0.0, 0.0, 0.0
        self._between_steps = True
        self._events = self._begin(job, work, session)

    @staticmethod
    def _begin(job: Job, work: Work, session: Session) -> JobEvents:
        return (yield from work.begin(session, job))

    def may_go_on(self, job: Job) -> bool:
        """Whether there is a next step, and the job is not held before it."""
        held = job.paused and self._time_steps >= job.steps_granted
        return not self._ended and not held and self.rest_s(job) == 0

    def rest_s(self, job: Job) -> float:
        """How long to wait before the next time step, so that a flight is not faster than its pace [s]."""
        if job.pace <= 0 or self._time_steps == 0:
            return 0.0
        return max(0.0, self._step_began + self._step_s / job.pace - time.monotonic())

    def next_event(self) -> Any:
        """What the job yields next; its end, with what it returned, and its failures are events too."""
        if self._between_steps:
            self._begun_at, self._between_steps = time.monotonic(), False
        try:
            event = next(self._events)
        except StopIteration as end:
            event = JobFinished(self._name, end.value)
        except NerfnavError as error:
            event = JobFailed(self._name, str(error))
        except Exception as error:
            _log.exception("the job %s broke", self._name)
            event = JobFailed(self._name, _describe(error))
        self._ended = isinstance(event, JobFailed | JobFinished)
        if isinstance(event, NavigationStep):
            self._time_steps += 1
            self._step_s, self._step_began, self._between_steps = event.plan.dt, self._begun_at, True
        return event

    def close(self) -> None:
        """Give up what is left of the job."""
        self._events.close()


def _describe(error: Exception) -> str:
    return f"This is a fault of the program ({type(error).__name__}: {error}); it goes on, and the log says more."

"""Worker: the one thread that computes, driven by the session alone.

`follow` passes the latest session on, and the worker reads it between two steps of a job. It closes a job that the
session no longer has, holds a paused one, and answers queries of the page between steps; of two requests the later
wins.
"""

import threading
import time
from collections.abc import Callable
from typing import Any

import torch

from nerfnav_app.jobs.events import COMPILING, Progress
from nerfnav_app.queries.query import Query
from nerfnav_app.state.actions import Notify, QueryAnswered, Reported, RunChanged
from nerfnav_app.state.runs import RunChange
from nerfnav_app.state.session import Session
from nerfnav_app.system import TORCH_THREADS, give_back
from nerfnav_app.worker.open_queries import OpenQueries
from nerfnav_app.worker.running_job import RunningJob
from nerfnav_app.worker.work import Work

_GIVE_BACK_EVERY_S = 10.0  # while a job runs, and after each


Posted = Reported | QueryAnswered | RunChanged | Notify
"""Messages of the worker to the session."""


class Worker:
    """Runs the job of the session on a thread of its own and posts its events."""

    def __init__(self, work: Work, post: Callable[[Posted], None], threads: int = TORCH_THREADS) -> None:
        """`post` takes messages for the session from this thread; `threads` is how many torch may use."""
        self._work, self._post, self._threads = work, post, threads
        self._changed = threading.Condition()
        self._wanted: Session | None = None
        self._stopping = False
        self._running: RunningJob | None = None
        self._compiles = False
        self._queries = OpenQueries(work)
        self._changed_runs: set[int] = set()
        self._gave_back = time.monotonic()
        self._thread = threading.Thread(target=self._run, name="nerfnav-worker", daemon=True)

    def start(self) -> None:
        """Start the thread of the worker."""
        self._thread.start()

    def follow(self, session: Session) -> None:
        """Take `session` as the latest one."""
        with self._changed:
            self._wanted = session
            self._queries.follow(session)
            self._changed.notify()
        self._report_wait(session)

    def ask_again(self, query: Query[Any]) -> None:
        """Answer a query again if the latest session asks it: it has dropped the answer."""
        with self._changed:
            self._queries.ask_again(query)
            self._changed.notify()

    def stop(self, timeout_s: float = 10.0) -> None:
        """Close the running job and end the thread, waiting at most `timeout_s` for the step in progress.

        Nothing happens where the worker was not started.
        """
        with self._changed:
            self._stopping = True
            self._changed.notify()
        if self._thread.ident is not None:
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
        """Wait for a session that needs work and return it; None when the thread is to end."""
        with self._changed:
            while not self._stopping:
                if self._wanted is not None and self._has_work(self._wanted):
                    return self._wanted
                self._changed.wait(self._rest_s(self._wanted))
            return None

    def _rest_s(self, session: Session | None) -> float | None:
        """Compute the time without work unless the session changes [s]; None where only a change brings work."""
        if self._running is None or session is None or session.job is None:
            return None
        return self._running.rest_s(session.job) or None

    def _has_work(self, session: Session) -> bool:
        running, job = self._running, session.job
        asked = self._queries.next(session, self._busy(session))
        if (running is None) != (job is None) or asked or self._open_changes(session):
            return True
        return running is not None and job is not None and (running.id != job.id or running.may_go_on(job))

    def _switch(self, session: Session) -> None:
        """Close the running job if the session has another or none, and begin that of the session."""
        job = session.job
        if self._running is not None and (job is None or job.id != self._running.id):
            self._running.close()
            self._running = None
            self._give_back()
        if job is not None and self._running is None:
            self._running = RunningJob(job, self._work, session)

    def _busy(self, session: Session) -> bool:
        """Check whether a job could go on at once."""
        return self._running is not None and session.job is not None and self._running.may_go_on(session.job)

    def _answer_one(self) -> None:
        with self._changed:
            # of the latest session: an older one may still ask what was answered a moment ago
            session = self._wanted
            query = self._queries.take(session, self._busy(session)) if session is not None else None
        if session is not None and query is not None:
            answered = self._queries.answer(session, query)
            if answered is not None:
                self._post(answered)

    def _open_changes(self, session: Session) -> list[RunChange]:
        """List the changes of stored runs that are not made yet; each is made once."""
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
            event = running.next_event(lambda progress: self._report_meanwhile(running, progress))
            self._post(Reported(running.id, event))

    def _report_meanwhile(self, running: RunningJob, progress: Progress) -> None:
        """Report the progress of a step before it ends."""
        self._compiles = progress.label == COMPILING
        self._post(Reported(running.id, progress))
        self._report_wait(self._wanted)

    def _report_wait(self, session: Session | None) -> None:
        """Report that a job cannot begin because the step of another one waits for the compiler."""
        running, job = self._running, None if session is None else session.job
        if running is None or job is None or not self._compiles:
            return
        if job.id != running.id and job.label != COMPILING:
            self._post(Reported(job.id, Progress(COMPILING, 0.0)))

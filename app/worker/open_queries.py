"""Open queries: those of the page that are not answered yet.

Answers go in steps. The worker takes some steps at a time, then the most urgent query again: what is not asked any more
is dropped, and what is less urgent goes on later. So a hand never waits for the rest of a long answer.
"""

import logging
import time
from collections.abc import Generator
from dataclasses import dataclass
from typing import Any

from nerfnav.core.errors import InvalidInputError, NerfnavError
from nerfnav_app.places.place import Place
from nerfnav_app.queries.catalog import pending_queries
from nerfnav_app.queries.query import Query
from nerfnav_app.state.actions import Notify, QueryAnswered
from nerfnav_app.state.session import Session
from nerfnav_app.worker.running_job import describe_fault
from nerfnav_app.worker.work import Work

_log = logging.getLogger(__name__)
_ANSWER_EVERY_S = 0.1  # pause between two answers while a job runs, which has the rest of the time
_LONGEST_PAUSE_S = 0.5  # an answer may have waited for the compiler
_STINT_S = 0.03  # so long an answer goes on, at least


@dataclass(frozen=True, eq=False)
class _BegunAnswer:
    query: Query[Any]
    place: Place
    steps: Generator[None, None, Any]


class OpenQueries:
    """Takes each query of a session once, as long as the session asks it."""

    def __init__(self, work: Work) -> None:
        """`work` answers them."""
        self._work = work
        self._answered: set[Query[Any]] = set()
        self._begun: dict[Query[Any], _BegunAnswer] = {}
        """Answers that are not complete, for the worker's thread alone."""
        self._last_answer = 0.0
        self._pauses: dict[type[Query[Any]], float] = {}
        """Time before which a busy worker answers no more queries of a kind [s]."""

    def follow(self, session: Session) -> None:
        """Forget the answers to what this session no longer asks."""
        self._answered.intersection_update(pending_queries(session))

    def ask_again(self, query: Query[Any]) -> None:
        """Forget the answer to a query, which the session did not want any more when it came."""
        self._answered.discard(query)

    def next(self, session: Session, busy: bool) -> Query[Any] | None:
        """Find the most urgent query without a complete answer; while a job is `busy`, not too soon after the last."""
        if busy and time.monotonic() - self._last_answer < _ANSWER_EVERY_S:
            return None
        open_ = (query for query in pending_queries(session) if not (busy and self.is_resting(query)))
        return next((query for query in open_ if query in self._begun or query not in self._answered), None)

    def is_resting(self, query: Query[Any]) -> bool:
        """Check whether the last answer to a query of its kind took so long that a job goes on first."""
        return query.pause > 0 and time.monotonic() < self._pauses.get(type(query), 0.0)

    def take(self, session: Session, busy: bool) -> Query[Any] | None:
        """Take the next query, which counts as answered from now on; drop what is not asked in this place any more."""
        asked = set(pending_queries(session)) if self._begun else set()
        for query, begun in tuple(self._begun.items()):
            if query not in asked or begun.place is not session.place:
                begun.steps.close()
                del self._begun[query]
                self._answered.discard(query)
        query = None if session.place is None else self.next(session, busy)
        if query is not None:
            self._answered.add(query)
        return query

    def answer(self, session: Session, query: Query[Any]) -> QueryAnswered | Notify | None:
        """Answer a query in the place of the session, or say why that fails; None where that goes on later."""
        began = time.monotonic()
        try:
            return self._go_on(session, query, began + _STINT_S)
        except NerfnavError as error:
            return Notify("No answer", str(error), bad=True)
        except Exception as error:
            _log.exception("answering %s failed", type(query).__name__)
            return Notify("Something broke", describe_fault(error), bad=True)
        finally:
            self._last_answer = now = time.monotonic()
            self._pauses[type(query)] = now + min(query.pause * (now - began), _LONGEST_PAUSE_S)

    def _go_on(self, session: Session, query: Query[Any], until: float) -> QueryAnswered | None:
        """Begin an answer, or go on with it, until some time [s]; the rest is for later."""
        begun = self._begun.pop(query, None)
        if begun is None:
            if session.place is None:
                raise InvalidInputError("no place is open")
            begun = _BegunAnswer(query, session.place, self._work.steps(session.place, query))
        try:
            next(begun.steps)
            while time.monotonic() < until:
                next(begun.steps)
        except StopIteration as end:
            return QueryAnswered(begun.query, end.value)
        self._begun[begun.query] = begun
        return None

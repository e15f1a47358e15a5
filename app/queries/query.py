"""Query: something that the page would like to know, asked of the worker until the session has the answer.

One file for each kind: what is asked, when it is pending, how it is answered, and how the session takes the result.
A query is complete in itself: it reads nothing of the session that it is answered in. catalog.py lists the kinds.
"""

from abc import ABC, abstractmethod
from collections.abc import Hashable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Generic, Self, TypeVar

from nerfnav.planner import PlannerConfig
from nerfnav_app.places.place import Place
from nerfnav_app.state.session import Session
from nerfnav_app.storage.run_store import RunStore

Result = TypeVar("Result")


@dataclass(frozen=True)
class Resources:
    """What queries are answered from; the worker's thread alone has them."""

    place: Place
    """The place that is open."""
    runs: RunStore | None = None
    """Stored runs; None where none are kept."""
    plan_configs: Mapping[str, PlannerConfig] = field(default_factory=dict)
    """Name of a planner to its settings, where they are not its own."""


@dataclass(frozen=True)
class Query(ABC, Generic[Result]):
    """Something that the page would like to know. Two queries that are equal have the same answer."""

    @property
    def pause(self) -> float:
        """For how many times as long as an answer took a job goes on before the next one of the same kind."""
        return 0.0

    @property
    def slot(self) -> Hashable:
        """Where its result is kept: one of the same slot takes its place."""
        return type(self)

    @classmethod
    @abstractmethod
    def pending(cls, session: Session) -> Iterator["Query[Any]"]:
        """The queries of this kind that the session has no answer to yet, the most urgent first."""

    @abstractmethod
    def answer(self, resources: Resources) -> Result:
        """Compute the result. Raises NerfnavError where there is none."""

    def apply(self, session: Session, result: Result) -> Session:
        """The session with the result: by default it is kept in its slot, for `result_in`."""
        return replace(session, results={**session.results, self.slot: (self, result)})

    def is_answered(self, session: Session) -> bool:
        """Whether the kept result of this slot is the answer to this query."""
        kept = session.results.get(self.slot)
        return kept is not None and kept[0] == self

    @classmethod
    def asked_in(cls, session: Session, slot: Hashable = None) -> Self | None:
        """The query whose result is kept; None where there is none."""
        kept = session.results.get(cls if slot is None else slot)
        return None if kept is None else kept[0]

    @classmethod
    def result_in(cls: "type[Query[Result]]", session: Session, slot: Hashable = None) -> Result | None:
        """The result that is kept; None where there is none."""
        kept = session.results.get(cls if slot is None else slot)
        return None if kept is None else kept[1]

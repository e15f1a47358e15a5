"""Query: a request of the page for data, which the worker answers.

One file for each kind: its arguments, when it is pending, its answer, and how the session takes the result. A query is
complete in itself: its answer reads nothing of the session. catalog.py lists the kinds.
"""

from abc import ABC, abstractmethod
from collections.abc import Generator, Hashable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Generic, Self, TypeVar

from nerfnav.core.steps import run_steps
from nerfnav.navigation import NavigateConfig
from nerfnav.planner import PlannerConfig
from nerfnav_app.places.place import Place
from nerfnav_app.state.plan import PlanRecord
from nerfnav_app.state.session import Session
from nerfnav_app.storage.run_store import RunStore

Result = TypeVar("Result")


@dataclass(frozen=True)
class Resources:
    """Resources of answers, for the worker's thread alone."""

    place: Place
    """The open place."""
    runs: RunStore | None = None
    """Stored runs; None where none are kept."""
    plan_configs: Mapping[str, PlannerConfig] = field(default_factory=dict)
    """Settings of planners by name; other planners use their own."""
    navigate: NavigateConfig = field(default_factory=NavigateConfig)
    """Configuration of flights, but for the noise, which is that of the session."""


@dataclass(frozen=True)
class Query(ABC, Generic[Result]):
    """Request of the page for data. Two queries that are equal have the same answer."""

    reads_field: ClassVar[bool] = False
    """True where the answer depends on the field, and is asked again once obstacles in it have moved."""

    @property
    def pause(self) -> float:
        """Pause of the kind after an answer while a job runs, as a multiple of the time that the answer took."""
        return 0.0

    @property
    def slot(self) -> Hashable:
        """Slot of the result: a new result replaces that of the same slot."""
        return type(self)

    @classmethod
    @abstractmethod
    def pending(cls, session: Session) -> Iterator["Query[Any]"]:
        """List the queries of this kind that the session wants, the most urgent first.

        Those whose answer is kept are left out by the catalog.
        """

    @abstractmethod
    def answer(self, resources: Resources) -> Result:
        """Compute the result. Raises NerfnavError where there is none."""

    def steps(self, resources: Resources) -> Generator[None, None, Result]:
        """Compute the result step by step: between two steps the worker answers what is more urgent, and drops what is
        not asked any more. Raises as `answer` does."""
        yield from ()
        return self.answer(resources)

    def apply(self, session: Session, result: Result) -> Session:
        """Take the result into the session: by default it is kept in its slot, for `result_in`.

        Returns the session itself where the result is not wanted any more: if the session asks it again, it is answered
        again.
        """
        return replace(session, results={**session.results, self.slot: (self, result)})

    def is_answered(self, session: Session) -> bool:
        """Check whether the kept result of this slot is the answer to this query."""
        kept = session.results.get(self.slot)
        return kept is not None and kept[0] == self

    @classmethod
    def asked_in(cls, session: Session, slot: Hashable = None) -> Self | None:
        """Return the query whose result is kept; None where there is none."""
        kept = session.results.get(cls if slot is None else slot)
        return None if kept is None else kept[0]

    @classmethod
    def result_in(cls: "type[Query[Result]]", session: Session, slot: Hashable = None) -> Result | None:
        """Return the kept result; None where there is none."""
        kept = session.results.get(cls if slot is None else slot)
        return None if kept is None else kept[1]


@dataclass(frozen=True)
class LongQuery(Query[Result]):
    """Request whose answer takes so long that a hand must not wait for it: it goes in steps."""

    @abstractmethod
    def steps(self, resources: Resources) -> Generator[None, None, Result]:
        """Compute the result step by step. Raises NerfnavError where there is none."""

    def answer(self, resources: Resources) -> Result:
        """Compute the result in one go. Raises as `steps` does."""
        return run_steps(self.steps(resources))


@dataclass(frozen=True)
class PlanQuery(Query[Result]):
    """Query about a plan as far as it is computed; its kinds add no fields."""

    plan: PlanRecord = field(compare=False)

    def __eq__(self, other: object) -> bool:
        """Compare iterations as objects: `plan` is kept, so that no other one can take its address."""
        return isinstance(other, PlanQuery) and type(other) is type(self) and self.plan.latest is other.plan.latest

    def __hash__(self) -> int:
        return hash((type(self), id(self.plan.latest)))

    @classmethod
    def result_for(cls: "type[PlanQuery[Result]]", plan: PlanRecord | None, session: Session) -> Result | None:
        """Return the result, if it is that of this plan."""
        asked = cls.asked_in(session)
        known = plan is not None and asked is not None and asked.plan.latest is plan.latest
        return cls.result_in(session) if known else None

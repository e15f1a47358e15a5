"""Notices: what the user is told once, in passing."""

from collections.abc import Hashable
from dataclasses import dataclass


@dataclass(frozen=True)
class Notice:
    """Something that the user should know now."""

    id: int
    """Rises by one from notice to notice."""
    title: str
    body: str
    bad: bool = False
    """Whether something failed."""
    cause: Hashable = None
    """What a person had asked for by then, `Session.asked`: once that is something else, it is old news."""

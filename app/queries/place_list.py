"""Query for the places in the library."""

from collections.abc import Iterator
from dataclasses import dataclass

from nerfnav_app.places.library import KeptPlace, PlaceLibrary
from nerfnav_app.queries.query import Query, Resources
from nerfnav_app.state.session import Session


@dataclass(frozen=True)
class PlaceListQuery(Query[tuple[KeptPlace, ...]]):
    """Query for the places in the library, by name."""

    stamp: tuple[int, ...]
    """Changes whenever the list may have changed."""

    @classmethod
    def pending(cls, session: Session) -> Iterator["PlaceListQuery"]:
        """Ask again whenever a place was opened, renamed or deleted."""
        yield cls((session.places_asked, int(session.job is None)))

    def answer(self, resources: Resources) -> tuple[KeptPlace, ...]:
        """Read the folder of the library."""
        return PlaceLibrary().entries()

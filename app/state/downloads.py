"""Files that tabs of the page ask for, and get."""

from dataclasses import dataclass, field


@dataclass(frozen=True)
class MapWish:
    """A map of the place that somebody wants to take away."""

    ending: str
    """Of the file, which says what kind of map: a key of `nerfnav.export.occupancy_map.ENDINGS`."""
    client: int
    """The tab that asks."""


@dataclass(frozen=True)
class Download:
    """A file for one tab."""

    id: int
    """That of the job which made it: it is sent once."""
    client: int
    """The tab that asked."""
    name: str
    content: bytes = field(repr=False)

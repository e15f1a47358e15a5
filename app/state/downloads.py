"""Files that tabs of the page ask for, and get; and the actions of a person who asks."""

from dataclasses import dataclass, field


@dataclass(frozen=True)
class MapWish:
    """A map of the place that somebody wants to take away."""

    ending: str
    """Of the file, which says what kind of map: a key of `nerfnav.export.occupancy_map.ENDINGS`."""
    client: int
    """The tab that asks."""


@dataclass(frozen=True)
class TrajectoryWish:
    """What a vehicle is to fly, as a file that somebody wants to take away."""

    format: str
    """Name of the format."""
    client: int
    """The tab that asks."""
    force: bool = False
    """Whether to have it also where it should not be flown."""


Wish = MapWish | TrajectoryWish
"""What is made for one tab."""


@dataclass(frozen=True)
class Download:
    """A file for one tab."""

    id: int
    """That of the job which made it: it is sent once."""
    client: int
    """The tab that asked."""
    name: str
    content: bytes = field(repr=False)


@dataclass(frozen=True)
class TakeMap:
    """Make a map of the place and send it to the tab that asks."""

    wish: MapWish


@dataclass(frozen=True)
class TakeTrajectory:
    """Make the file for a vehicle, once it is judged, and send it to the tab that asks."""

    wish: TrajectoryWish


DownloadAction = TakeMap | TakeTrajectory

"""Actions of a person who takes a file away that must be made first."""

from dataclasses import dataclass

from app.state.downloads import MapWish, TrajectoryWish


@dataclass(frozen=True)
class TakeMap:
    """Make a map of the place and send it to the tab that asks."""

    wish: MapWish


@dataclass(frozen=True)
class TakeTrajectory:
    """Make the file for a vehicle, once it is judged, and send it to the tab that asks."""

    wish: TrajectoryWish


DownloadAction = TakeMap | TakeTrajectory

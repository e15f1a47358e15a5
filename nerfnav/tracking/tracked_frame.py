"""How a track stands after a frame."""

from enum import Enum


class TrackStatus(Enum):
    """What became of a frame; the value is what a user reads."""

    SEARCHING = "nothing is known yet: no one place looks like the picture"
    FOUND = "found from nothing, by looking everywhere"
    FOLLOWED = "followed by the picture"
    PREDICTED = "the picture said nothing or disagreed: the motion model alone leads"
    LOST = "the track is lost: pictures disagree, and no one place looks like them"
    FOUND_AGAIN = "the track was lost, and found again by looking everywhere"

    @property
    def knows(self) -> bool:
        """Whether there is a pose."""
        return self not in (TrackStatus.SEARCHING, TrackStatus.LOST)

    @property
    def updated(self) -> bool:
        """Whether the frame's own picture gave the pose."""
        return self in (TrackStatus.FOUND, TrackStatus.FOLLOWED, TrackStatus.FOUND_AGAIN)

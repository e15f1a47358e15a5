"""Clock of a vehicle: judge the stamps of its pictures, which may be wrong once or begin anew.

Stamps normally grow. One that goes far back, or far ahead, is doubtful: it is wrong, or the clock began anew (a vehicle
that was started again, a simulator that was reset). The next stamp decides: it follows the last one that was used, or
the doubtful one. So pictures are used again from the second one on, and one wrong stamp loses no pose.
"""

import math
from enum import Enum

LATE_S = 1.0
"""A stamp up to this much before the last one belongs to a picture that came late [s]."""
PAUSE_S = 3600.0
"""Longest pause between two pictures of one clock [s]."""
_READABLE_S = 1e11


class Stamp(Enum):
    """Judgement of a stamp."""

    NEXT = "it follows the last one that was used"
    LATE = "it is not newer than the last one that was used"
    DOUBTFUL = "it is far from the last one that was used"
    RESTARTED = "it follows the doubtful one before it: the clock began anew"


class VehicleClock:
    """The stamps of one vehicle."""

    def __init__(self) -> None:
        """Begin without a stamp."""
        self.last: float | None = None
        """Time of the last picture that was used [s]."""
        self.doubtful: float | None = None
        """Doubtful stamp since then, the newest [s]."""

    def judge(self, time: float) -> Stamp:
        """Judge a finite stamp [s]; those that are not used stay known, those that are used go to `use`."""
        if self.last is None or 0 < time - self.last <= PAUSE_S:
            return Stamp.NEXT
        if self.doubtful is not None and 0 < time - self.doubtful <= PAUSE_S:
            return Stamp.RESTARTED
        if -LATE_S <= time - self.last <= 0:
            return Stamp.LATE
        self.doubtful = time
        return Stamp.DOUBTFUL

    def use(self, time: float) -> str | None:
        """Let a picture of this time [s] be the last one; return a sentence where a doubt is settled by it."""
        last, doubtful = math.nan if self.last is None else self.last, self.doubtful
        self.last, self.doubtful = time, None
        if doubtful is None:
            return None
        if 0 < time - last <= PAUSE_S:
            return (
                f"a picture with a wrong stamp was not used: {format_stamp(doubtful)}, between pictures of "
                f"{format_stamp(last)} and {format_stamp(time)}"
            )
        return (
            f"the vehicle's clock began anew: after {format_stamp(last)} came {format_stamp(doubtful)} and "
            f"{format_stamp(time)}; it is looked for everywhere"
        )


def format_stamp(time: float) -> str:
    """Format a stamp [s] for people, to the millisecond where that is shorter than its digits."""
    return f"{time:.3f} s" if abs(time) < _READABLE_S else f"{time:g} s"

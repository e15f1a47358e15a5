"""What has happened in a flight, and when: the marks of the timeline."""

from collections.abc import Iterable, Iterator

from nerfnav.navigation import NavigationStep, Recovery
from nerfnav.tracking import TrackStatus
from nerfnav_app.state.runs import Timed
from nerfnav_app.state.tracks import TrackRecord

Mark = tuple[float, str]
_LETTER, _GAP = 0.028, 0.01
"""Width of a letter, and what is left free between words, in lengths of the slider."""


def marks_of(flight: Timed) -> tuple[Mark, ...]:
    """Time [s] and word of each event, in the order of time; what goes on is marked where it begins."""
    if isinstance(flight, TrackRecord):
        return _marks_of_track(flight)
    steps = flight.steps
    happened = {
        "hit": [step.touched for step in steps],
        "lost": [_is_lost(step) for step in steps],
        "blind": [step.recovery in (Recovery.BLIND, Recovery.ADRIFT) for step in steps],
        "braked": [step.recovery is Recovery.BACKUP for step in steps],
        "found": [step.recovery is Recovery.RELOCALISED for step in steps],
        "gust": _at(flight.gusts, len(steps)),
        "goal moved": _at(flight.goals_moved, len(steps)),
    }
    marks = ((steps[index].time, word) for word, told in happened.items() for index in _beginnings(told))
    return tuple(sorted(marks))


def spaced(marks: tuple[Mark, ...], end: float) -> tuple[Mark, ...]:
    """The marks of a slider from 0 to `end` [s], whose words do not run into one another.

    Of words that would, that of the earlier event stays; the numbers at both ends give way to words. What loses its
    word stays as a mark.
    """
    taken: list[tuple[float, float]] = []
    told = {}
    for value, word in (*marks, (0.0, "0"), (end, f"{end:g}")):
        half = 0.5 * (_LETTER * len(word) + _GAP)
        middle = value / end if end else 0.0
        if all(middle + half <= low or middle - half >= high for low, high in taken):
            taken.append((middle - half, middle + half))
            told[value] = word
        else:
            told.setdefault(value, "")
    return tuple(sorted(told.items()))


def _marks_of_track(track: TrackRecord) -> tuple[Mark, ...]:
    status, times = [step.tracked.status for step in track.steps], track.times
    happened = {
        "lost": [kind is TrackStatus.LOST for kind in status],
        "found": [kind in (TrackStatus.FOUND, TrackStatus.FOUND_AGAIN) for kind in status],
    }
    return tuple(sorted((times[index], word) for word, told in happened.items() for index in _beginnings(told)))


def _is_lost(step: NavigationStep) -> bool:
    return step.recovery in (Recovery.WIDENED, Recovery.SEARCHED, Recovery.LOST)


def _at(indices: Iterable[int], count: int) -> list[bool]:
    return [index in set(indices) for index in range(count)]


def _beginnings(told: list[bool]) -> Iterator[int]:
    return (index for index, now in enumerate(told) if now and not (index and told[index - 1]))

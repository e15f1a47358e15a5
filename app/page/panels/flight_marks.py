"""What has happened in a flight, and when: the marks of the timeline."""

from collections.abc import Iterable, Iterator

from app.state.records import FlightRecord
from nerfnav.navigation import NavigationStep, Recovery


def marks_of(flight: FlightRecord) -> tuple[tuple[float, str], ...]:
    """Time [s] and word of each event, in the order of time; what goes on is marked where it begins."""
    steps = flight.steps
    happened = {
        "hit": [step.touched for step in steps],
        "lost": [_is_lost(step) for step in steps],
        "braked": [step.recovery is Recovery.BACKUP for step in steps],
        "found": [step.recovery is Recovery.RELOCALISED for step in steps],
        "gust": _at(flight.gusts, len(steps)),
        "goal moved": _at(flight.goals_moved, len(steps)),
    }
    marks = ((steps[index].time, word) for word, told in happened.items() for index in _beginnings(told))
    return tuple(sorted(marks))


def _is_lost(step: NavigationStep) -> bool:
    return step.recovery not in (None, Recovery.RELOCALISED, Recovery.BACKUP)


def _at(indices: Iterable[int], count: int) -> list[bool]:
    return [index in set(indices) for index in range(count)]


def _beginnings(told: list[bool]) -> Iterator[int]:
    return (index for index, now in enumerate(told) if now and not (index and told[index - 1]))

"""Timeline of a flight or a track: choose the time that the scene, the pictures and the charts show.

Its marks are the events of a flight, each at its time.
"""


from bisect import bisect
from collections.abc import Callable, Iterable, Iterator

import viser
from viser._messages import GuiSliderMark

from nerfnav.navigation import NavigationStep, SupervisorState
from nerfnav.tracking import TrackStatus
from nerfnav_app.state.actions import Command
from nerfnav_app.state.runs import PlayBack, Scrub, TimedRecord
from nerfnav_app.state.session import Session
from nerfnav_app.state.tracks import TrackRecord

Mark = tuple[float, str]
_LETTER, _GAP = 0.028, 0.01
"""Width of a letter, and what is left free between words, in lengths of the slider."""


def list_marks(flight: TimedRecord) -> tuple[Mark, ...]:
    """Time [s] and word of each event, in the order of time; what goes on is marked where it begins."""
    if isinstance(flight, TrackRecord):
        return _marks_of_track(flight)
    steps = flight.steps
    happened = {
        "hit": [step.touched for step in steps],
        "lost": [_is_lost(step) for step in steps],
        "blind": [step.recovery in (SupervisorState.BLIND, SupervisorState.ADRIFT) for step in steps],
        "braked": [step.recovery is SupervisorState.BACKUP for step in steps],
        "found": [step.recovery is SupervisorState.RELOCALISED for step in steps],
        "gust": _at(flight.gusts, len(steps)),
        "goal moved": _at(flight.goals_moved, len(steps)),
    }
    marks = ((steps[index].time, word) for word, told in happened.items() for index in _beginnings(told))
    return tuple(sorted(marks))


def space_marks(marks: tuple[Mark, ...], end: float) -> tuple[Mark, ...]:
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
    return step.recovery in (SupervisorState.WIDENED, SupervisorState.SEARCHED, SupervisorState.LOST)


def _at(indices: Iterable[int], count: int) -> list[bool]:
    return [index in set(indices) for index in range(count)]


def _beginnings(told: list[bool]) -> Iterator[int]:
    return (index for index, now in enumerate(told) if now and not (index and told[index - 1]))


_PLAY, _PAUSE = "Play back", "Hold"


class TimelinePanel:
    """A slider over the flight's time and a button that moves it, above the tabs, for they all show that time."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """`post` takes what the user asks."""
        self._server, self._post = server, post
        self._slider = server.gui.add_slider(
            "Time [s]", 0.0, 1.0, 0.1, 0.0, visible=False, hint="Which moment of the flight is shown"
        )
        self._button = server.gui.add_button(_PLAY, icon=viser.Icon.PLAYER_PLAY, color="gray", visible=False)
        self._flight: TimedRecord | None = None
        self._times: tuple[float, ...] = (0.0,)
        self._asked: int | None = None
        self._playing = False
        self._slider.on_update(self._scrub)

        @self._button.on_click
        async def _(_: viser.GuiEvent) -> None:
            post(PlayBack(not self._playing))

    async def _scrub(self, event: viser.GuiEvent) -> None:
        if event.client is None:
            return  # the session wrote it
        self._asked = nearest(self._times, float(self._slider.value))
        self._post(Scrub(self._asked))

    def show(self, session: Session) -> None:
        """Show where in time the flight is, and what has happened in it; while it flies, that is its last step."""
        flight, shown = session.timed, session.runs.shown(session.timed)
        visible = flight is not None and len(flight.steps) > 1
        self._slider.visible = visible
        self._button.visible = visible and not session.growing
        if not visible or flight is None or shown is None:
            return
        self._slider.disabled = session.growing
        if flight is not self._flight:
            self._flight, self._asked = flight, None
            self._span(flight)
        at = len(shown.steps) - 1
        # a hand that holds the slider is ahead of the session: it must not be pulled back
        if self._asked in (None, at) or session.runs.timeline.playing:
            self._asked = None
            self._slider.value = round(self._times[at], 3)
        if self._playing != session.runs.timeline.playing:
            self._playing = session.runs.timeline.playing
            self._button.label = _PAUSE if self._playing else _PLAY
            self._button.icon = viser.Icon.PLAYER_PAUSE if self._playing else viser.Icon.PLAYER_PLAY

    def _span(self, flight: TimedRecord) -> None:
        """Reach over all of the flight, with a mark at each event."""
        self._times = flight.times
        end = round(self._times[-1], 3)
        marks = space_marks(list_marks(flight), end)
        with self._server.atomic():
            self._slider.step, self._slider.max = flight.tick, end
            self._slider.precision = max(0, len(f"{flight.tick:.6g}".partition(".")[2]))
            # viser takes marks where a slider is made, and has only an inner name for them later
            self._slider._marks = tuple(GuiSliderMark(value, label or None) for value, label in marks)


def nearest(times: tuple[float, ...], time: float) -> int:
    """Which of the times, in order, is nearest to another [s]."""
    after = bisect(times, time)
    return min(range(max(0, after - 1), min(after + 1, len(times))), key=lambda index: abs(times[index] - time))

"""Timeline of a flight or a track: choose the time that the scene, the pictures and the charts show.

Its marks are the events of a flight, each at its time; below it they are listed.
"""

from bisect import bisect
from collections.abc import Callable, Iterable, Iterator, Mapping
from types import MappingProxyType
from typing import NamedTuple

import viser
from viser._messages import GuiSliderMark

from nerfnav.navigation import SupervisorAction, SupervisorState
from nerfnav.tracking import TrackStatus
from nerfnav_app.page.kit.html import EventEntry, events
from nerfnav_app.page.kit.widgets import post_on
from nerfnav_app.state.actions import Command
from nerfnav_app.state.runs import PlayBack, Scrub, TimedRecord
from nerfnav_app.state.session import Session
from nerfnav_app.state.tracks import TrackRecord
from nerfnav_app.text import capital

_MOST_LISTED = 12
"""Number of events that are listed below the slider; all have marks."""
_HELP = {
    "hit": "the body touched the ground truth",
    "searching": "the estimate is not trusted: the robot holds and localizes globally",
    "lost": "the robot was searched for in vain: it comes to rest",
    "landing": "the robot was searched for in vain: it lands on the ground below",
    "tracking": "the estimate is sure enough again: the robot follows its plan",
    "blind": "the pictures show nothing that the filter can use: it predicts by the dynamics alone",
    "braked": "no safe plan was found: the robot followed its fallback trajectory",
    "found": "the pose is known again",
    "gust": "the robot was pushed once",
    "goal moved": "the goal was moved",
}
_STATES = (SupervisorState.BLIND, SupervisorState.SEARCHING, SupervisorState.LOST, SupervisorState.LANDING)


_SUPERVISED = ("found", "tracking", *(state.name.lower() for state in _STATES))
"""Events that are changes of the supervisor's state."""


class Mark(NamedTuple):
    """Mark of the slider: an event and its time."""

    time: float
    """[s]"""
    label: str


def list_marks(flight: TimedRecord) -> tuple[Mark, ...]:
    """List the events of a flight or a track in the order of time; one that lasts is marked at its beginning."""
    if isinstance(flight, TrackRecord):
        return _marks_of_track(flight)
    steps = flight.steps
    happened = {
        "hit": [step.touched for step in steps],
        **{state.name.lower(): [step.state is state for step in steps] for state in _STATES},
        "braked": [step.recovery is SupervisorAction.BACKUP for step in steps],
        "found": [step.recovery is SupervisorAction.RELOCALISED for step in steps],
        "tracking": [step.recovery is None and step.change is not None for step in steps],
        "gust": _at(flight.gusts, len(steps)),
        "goal moved": _at(flight.goals_moved, len(steps)),
    }
    return tuple(sorted(Mark(steps[index].time, label) for label, on in happened.items() for index in _beginnings(on)))


def list_reasons(flight: TimedRecord) -> dict[Mark, str]:
    """List the supervisor's reasons, with their numbers, by the marks of its changes of state."""
    if isinstance(flight, TrackRecord):
        return {}
    reasons = {step.time: step.change.reason for step in flight.steps if step.change is not None}
    return {
        mark: reasons[mark.time] for mark in list_marks(flight) if mark.label in _SUPERVISED and mark.time in reasons
    }


def explain_mark(label: str, reason: str | None = None) -> str:
    """Explain the word of an event, by its reason where there is one."""
    return _HELP[label] if reason is None else f"{_HELP[label]} ({reason})"


def label_slider(
    marks: tuple[Mark, ...], end: float, reasons: Mapping[Mark, str] = MappingProxyType({})
) -> tuple[Mark, ...]:
    """Label a slider from 0 to `end` [s]: a number at both ends, and at each event its tooltip.

    page.js shows a label that is no number as a tooltip alone, so that no label lies on another.
    """
    labels: dict[float, str] = {}
    for mark in marks:
        time, label = mark
        text = f"{capital(label)} at {time:.3g} s: {explain_mark(label, reasons.get(mark))}"
        labels[time] = f"{labels[time]} · {text}" if time in labels else text
    ends = (Mark(0.0, "0"), Mark(end, f"{end:g}"))
    return tuple(sorted((*(Mark(time, label) for time, label in labels.items()), *ends)))


def list_events(marks: tuple[Mark, ...], reasons: Mapping[Mark, str] = MappingProxyType({})) -> str:
    """Format the events with their times as HTML, each with its explanation as a tooltip."""
    listed = [
        EventEntry(f"{mark.label} {mark.time:.3g} s", explain_mark(mark.label, reasons.get(mark)))
        for mark in marks[:_MOST_LISTED]
    ]
    more = len(marks) - len(listed)
    return events([*listed, EventEntry(f"and {more} more", "Hover over their marks")] if more else listed)


def _marks_of_track(track: TrackRecord) -> tuple[Mark, ...]:
    status, times = [step.tracked.status for step in track.steps], track.times
    happened = {
        "lost": [kind is TrackStatus.LOST for kind in status],
        "found": [kind in (TrackStatus.FOUND, TrackStatus.FOUND_AGAIN) for kind in status],
    }
    return tuple(sorted(Mark(times[index], label) for label, on in happened.items() for index in _beginnings(on)))


def _at(indices: Iterable[int], count: int) -> list[bool]:
    return [index in set(indices) for index in range(count)]


def _beginnings(on: list[bool]) -> Iterator[int]:
    return (index for index, now in enumerate(on) if now and not (index and on[index - 1]))


_PLAY, _PAUSE = "Play back", "Pause playback"


class TimelinePanel:
    """Panel of the timeline: a slider over the flight's time and a button that plays it, above the tabs."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """Add the widgets; `post` takes the commands."""
        self._server = server
        self._slider = server.gui.add_slider(
            "Time [s]", 0.0, 1.0, 0.1, 0.0, visible=False, hint="Time of the flight that is shown"
        )
        self._events = server.gui.add_html("", visible=False)
        self._play = server.gui.add_button(_PLAY, icon=viser.Icon.PLAYER_PLAY, color="gray", visible=False)
        self._flight: TimedRecord | None = None
        self._times: tuple[float, ...] = (0.0,)
        self._asked: int | None = None
        self._playing = False
        post_on(self._slider.on_update, post, self._scrub)
        post_on(self._play.on_click, post, lambda: PlayBack(not self._playing))

    def _scrub(self) -> Scrub:
        self._asked = nearest(self._times, float(self._slider.value))
        return Scrub(self._asked)

    def show(self, session: Session) -> None:
        """Show the time and the events of the flight; while it flies, its last step."""
        flight, shown = session.timed, session.runs.shown(session.timed)
        visible = flight is not None and len(flight.steps) > 1
        self._slider.visible = visible
        self._events.visible = visible and bool(self._events.content)
        self._play.visible = visible and not session.growing
        if not visible or flight is None or shown is None:
            return
        self._slider.disabled = session.growing
        if flight is not self._flight:
            self._flight, self._asked = flight, None
            self._span(flight)
        at = len(shown.steps) - 1
        # a user who drags the slider is ahead of the session: it must not be pulled back
        if self._asked in (None, at) or session.runs.timeline.playing:
            self._asked = None
            self._slider.value = round(self._times[at], 3)
        if self._playing != session.runs.timeline.playing:
            self._playing = session.runs.timeline.playing
            self._play.label = _PAUSE if self._playing else _PLAY
            self._play.icon = viser.Icon.PLAYER_PAUSE if self._playing else viser.Icon.PLAYER_PLAY

    def _span(self, flight: TimedRecord) -> None:
        """Span all of the flight, with a mark at each event."""
        self._times = flight.times
        end = round(self._times[-1], 3)
        happened, reasons = list_marks(flight), list_reasons(flight)
        self._events.content = list_events(happened, reasons) if happened else ""
        self._events.visible = bool(happened)
        with self._server.atomic():
            self._slider.step, self._slider.max = flight.tick, end
            self._slider.precision = max(0, len(f"{flight.tick:.6g}".partition(".")[2]))
            # viser takes marks where a slider is made, and has only an inner name for them later
            self._slider._marks = tuple(GuiSliderMark(*mark) for mark in label_slider(happened, end, reasons))


def nearest(times: tuple[float, ...], time: float) -> int:
    """Find the index of the sorted time that is nearest to another [s]."""
    after = bisect(times, time)
    return min(range(max(0, after - 1), min(after + 1, len(times))), key=lambda index: abs(times[index] - time))

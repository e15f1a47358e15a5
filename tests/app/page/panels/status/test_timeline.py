"""The timeline's marks, the charts' cursor and the help's keys, without a page."""

from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest

from nerfnav.navigation import StateChange, SupervisorAction, SupervisorState
from nerfnav_app.page.kit.chart import with_cursor
from nerfnav_app.page.panels.status.command_palette import entries
from nerfnav_app.page.panels.status.timeline import (
    Mark,
    explain_mark,
    label_slider,
    list_events,
    list_marks,
    list_reasons,
)
from nerfnav_app.places.ends import End, EndRole, Ends
from nerfnav_app.state import actions as m
from nerfnav_app.state.flight import FlightRecord
from nerfnav_app.state.session import Session
from tests.app.doubles import flight_step
from tests.app.sessions import after, planned, reports

ENDS = Ends(End((-0.7, 0.0, 0.4)), End((0.7, 0.1, 0.4)))
_WORD_OF_KEY = {"space": "space", "pageup": "page up", "pagedown": "page up, down", "escape": "esc"}


def test_events_of_a_flight_are_marked_once_where_they_begin() -> None:
    steps = [flight_step(ENDS, index) for index in range(8)]
    steps[2:4] = (replace(step, touched=True) for step in steps[2:4])
    steps[4:6] = (replace(step, recovery=SupervisorAction.WIDENED) for step in steps[4:6])
    steps[6] = replace(steps[6], recovery=SupervisorAction.RELOCALISED)
    steps[1] = replace(steps[1], gust_mps=0.2)
    marks = list_marks(FlightRecord(ENDS, tuple(steps), goals_moved=(7,)))
    times = [step.time for step in steps]
    assert marks == (
        (times[1], "gust"), (times[2], "hit"), (times[4], "searching"), (times[6], "found"), (times[7], "goal moved"),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("recovery", "word"),
    [(SupervisorAction.BACKUP, "braked"), (SupervisorAction.BLIND, "blind"), (SupervisorAction.ADRIFT, "searching")],
)
def test_a_robot_that_brakes_for_want_of_a_way_or_sees_nothing_is_not_lost(
    recovery: SupervisorAction, word: str
) -> None:
    steps = [flight_step(ENDS, index) for index in range(4)]
    steps[2] = replace(steps[2], recovery=recovery)
    assert list_marks(FlightRecord(ENDS, tuple(steps))) == ((steps[2].time, word),)


def test_marks_have_numbers_at_the_ends_alone_and_events_a_tooltip_that_explains_them() -> None:
    assert label_slider((), 5.0) == ((0.0, "0"), (5.0, "5"))
    *_, blind, both, _ = label_slider((Mark(0.1, "blind"), Mark(0.4, "gust"), Mark(0.4, "lost")), 5.0)
    assert blind.label == f"Blind at 0.1 s: {explain_mark('blind')}" and "filter" in explain_mark("blind")
    assert both.label.startswith("Gust at 0.4 s") and "· Lost at 0.4 s" in both.label, "one mark for one time"


def test_changes_of_the_supervisors_state_are_marked_with_their_reasons() -> None:
    steps = [flight_step(ENDS, index) for index in range(5)]
    blind = StateChange(2, SupervisorState.TRACKING, SupervisorState.BLIND, "standard deviation 0.05 m")
    again = StateChange(3, SupervisorState.BLIND, SupervisorState.TRACKING, "standard deviation 0.01 m")
    steps[2] = replace(steps[2], recovery=SupervisorAction.BLIND, change=blind, touched=True)
    steps[3] = replace(steps[3], change=again)
    flight = FlightRecord(ENDS, tuple(steps))
    marks, reasons = list_marks(flight), list_reasons(flight)
    assert {mark.label: reasons.get(mark) for mark in marks} == {
        "blind": blind.reason, "hit": None, "tracking": again.reason,
    }  # fmt: skip
    for text in (label_slider(marks, 5.0, reasons)[1].label, list_events(marks, reasons)):
        assert f"({blind.reason})" in text


def test_events_are_listed_with_their_times_and_many_are_counted() -> None:
    listed = list_events((Mark(0.1, "blind"), Mark(2.0, "gust")))
    assert "blind 0.1 s" in listed and "gust 2 s" in listed and explain_mark("blind") in listed
    assert "and 8 more" in list_events(tuple(Mark(0.1 * index, "hit") for index in range(20)))


def test_gusts_and_moves_of_the_goal_are_kept_with_their_flight(opened: Session) -> None:
    begun = after(planned(opened), m.StartFlight())
    flying = reports(begun, flight_step(begun.ends, 0), flight_step(begun.ends, 1))
    moved = after(flying, m.MoveEnd(EndRole.GOAL, End((0.1, 0.2, 0.5))))
    moved = reports(moved, replace(flight_step(begun.ends, 2), gust_mps=0.1))
    assert moved.flight is not None and moved.flight.gusts == moved.flight.goals_moved == (2,)
    started = after(flying, m.MoveEnd(EndRole.START, End((0.1, 0.2, 0.5))))
    assert started.flight is not None and started.flight.goals_moved == ()


def test_the_cursor_of_a_chart_stands_at_its_time_and_leaves_the_lines_alone() -> None:
    rows = np.array([[0.0, 1.0, 2.0], [4.0, 2.0, 8.0]])
    across, line, cursor = with_cursor(rows, 1.5)
    assert across.tolist() == [0, 1, 1.5, 1.5, 1.5, 2] and (np.diff(across) >= 0).all()
    np.testing.assert_allclose(np.interp([0, 1, 2], across, line), rows[1])
    assert cursor.max() == 8 and across[cursor.argmax()] == 1.5 and (cursor == 2).sum() == 5
    assert with_cursor(rows, None)[-1].tolist() == [2, 2, 2]


def test_help_lists_every_key() -> None:
    help = (files("nerfnav_app.page") / "page.html").read_text()
    for entry in entries():
        if entry.key is not None:
            assert str(_WORD_OF_KEY.get(entry.key, entry.key)) in help.split("<dl>")[1], entry.label


def test_every_word_of_an_event_is_explained() -> None:
    states = (*SupervisorAction, None)
    steps = tuple(replace(flight_step(ENDS, index), recovery=state) for index, state in enumerate(states))
    touched = (*steps, replace(flight_step(ENDS, 8), touched=True, index=len(steps), gust_mps=0.1))
    words = {mark.label for mark in list_marks(FlightRecord(ENDS, touched, goals_moved=(2,)))}
    assert {"gust", "hit", "lost", "searching", "landing", "blind", "found", "goal moved"} <= words
    assert all(len(explain_mark(word)) > len(word) for word in words)

"""The status line of a flight: how it ended, and its gusts."""

from dataclasses import replace

import pytest

from nerfnav.navigation import EpisodeOutcome, StateChange, SupervisorState
from nerfnav_app.jobs.events import JobFinished
from nerfnav_app.page.kit.html import warning
from nerfnav_app.page.panels.status.command_palette import entries
from nerfnav_app.page.panels.status.status import describe_landing, status
from nerfnav_app.page.panels.status.timeline import list_marks
from nerfnav_app.state import actions as m
from nerfnav_app.state.flight import FlightRecord
from nerfnav_app.state.runs import PlayBack
from nerfnav_app.state.session import Session
from tests.app.doubles import flight_step
from tests.app.sessions import after, planned, reports


def landed(opened: Session, outcome: EpisodeOutcome, gust_mps: float | None = None) -> Session:
    """A session after a flight of five time steps, with a gust in the third; the last one touches where it collided."""
    begun = after(planned(opened), m.StartFlight())
    steps = [flight_step(begun.ends, index, outcome if index == 5 else None) for index in range(6)]
    steps[3] = replace(steps[3], gust_mps=gust_mps)
    steps[5] = replace(steps[5], touched=outcome is EpisodeOutcome.COLLIDED)
    return reports(begun, *steps, JobFinished("fly"))


def test_every_outcome_of_a_flight_has_its_words(opened: Session) -> None:
    flights = [landed(opened, outcome).flight for outcome in EpisodeOutcome]
    assert all(flight is not None for flight in flights)
    assert len({describe_landing(flight) for flight in flights if flight is not None}) == len(EpisodeOutcome)


def test_a_lost_robot_has_the_reason_for_which_it_was_given_up(opened: Session) -> None:
    flight = landed(opened, EpisodeOutcome.LOST).flight
    assert flight is not None and describe_landing(flight).endswith("from the goal")
    change = StateChange(4, SupervisorState.SEARCHING, SupervisorState.LOST, "searched in vain: nothing was seen")
    steps = (*flight.steps[:4], replace(flight.steps[4], change=change), *flight.steps[5:])
    assert describe_landing(replace(flight, steps=steps)).endswith(". Searched in vain: nothing was seen.")


@pytest.mark.parametrize(
    ("outcome", "words"),
    [(EpisodeOutcome.COLLIDED, "Hit something at 0.5 s"), (EpisodeOutcome.OUTSIDE, "Left the place at 0.5 s")],
)
def test_a_flight_that_hit_something_or_left_the_place_is_over_and_told_in_red(
    opened: Session, outcome: EpisodeOutcome, words: str
) -> None:
    session = landed(opened, outcome)
    assert status(session).text.startswith(words) and status(session).html is warning
    assert session.job is None and not session.in_flight and session.may_begin
    hits = [mark.label for mark in list_marks(session.flight or FlightRecord(session.ends))]
    assert hits == (["hit"] if outcome is EpisodeOutcome.COLLIDED else [])


def test_keys_work_after_a_hit_as_after_any_flight(opened: Session) -> None:
    session = landed(opened, EpisodeOutcome.COLLIDED)
    space = next(entry for entry in entries() if entry.key == "space")
    assert space.asks(session) == PlayBack(True)
    assert after(session, PlayBack(True)).runs.timeline.playing
    assert after(session, m.Pause()) is session and after(session, m.Resume()) is session
    assert after(session, m.Reset()).flight is None
    assert after(session, m.StartFlight()).in_flight


def test_the_status_names_a_gust_that_was_survived_and_one_before_the_end(opened: Session) -> None:
    reached = status(landed(opened, EpisodeOutcome.REACHED, gust_mps=0.123)).text
    assert reached.endswith("Gust of 0.12 m/s at 0.3 s: survived.")
    hit = status(landed(opened, EpisodeOutcome.COLLIDED, gust_mps=0.123)).text
    assert hit.startswith("Hit something at 0.5 s") and hit.endswith("at 0.3 s: 0.2 s before the end.")
    assert "Gust" not in status(landed(opened, EpisodeOutcome.REACHED)).text


def test_the_key_of_gusts_answers_after_a_flight_and_not_before_the_first(opened: Session) -> None:
    gust = next(entry for entry in entries() if entry.label == "Gust")
    assert gust.asks(opened) is None
    assert gust.asks(landed(opened, EpisodeOutcome.REACHED)) == m.Gust()

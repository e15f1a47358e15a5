"""The status line: how a flight ended, by where the robot is and by which settings it was flown."""

from dataclasses import replace

from nerfnav.navigation.episode import EpisodeOutcome
from nerfnav_app.jobs.events import JobFinished
from nerfnav_app.page.kit.html import caution, fine, note
from nerfnav_app.page.panels.flight.estimate import explain_no_search
from nerfnav_app.page.panels.plan.plan import OLD
from nerfnav_app.page.panels.status.status import status
from nerfnav_app.state import actions as m
from nerfnav_app.state.session import Session
from tests.app.doubles import flight_step
from tests.app.sessions import after, planned, reports


def landed(session: Session, at: int = 8) -> Session:
    """The session after a flight whose robot believes at a step to have arrived; the goal is at step 8."""
    begun = after(planned(session), m.StartFlight())
    steps = [flight_step(begun.ends, index) for index in range(at)]
    return reports(begun, *steps, flight_step(begun.ends, at, EpisodeOutcome.REACHED), JobFinished("fly"))


def test_only_a_robot_at_the_goal_has_arrived(opened: Session) -> None:
    there, away = status(landed(opened)), status(landed(opened, at=6))
    assert there.html is fine and there.text.startswith("Arrived after 0.8 s")
    assert away.html is caution and away.text.startswith("Believes to have arrived after 0.6 s")


def test_a_setting_that_is_changed_after_a_flight_marks_the_headline_until_it_is_undone(opened: Session) -> None:
    session = landed(opened)
    for settings, name, value in ((m.Settings.FLIGHT, "seed", 7), (m.Settings.PLAN, "duration_s", 3.0)):
        changed = after(session, m.Adjust(settings, name, value))
        assert status(changed).html is note and status(changed).text == f"{OLD} settings: {status(session).text}"
        assert status(after(changed, m.Undo())) == status(session)


def test_a_flight_in_a_draft_that_was_replaced_says_what_to_do_now(opened: Session) -> None:
    def made_by(session: Session, name: str) -> Session:
        assert session.place is not None
        field = session.place.field
        made = replace(field, info=replace(field.info, made_by=name))  # type: ignore[type-var]
        return replace(session, place=replace(session.place, field=made))

    flown = landed(made_by(opened, "draft"))
    assert flown.plan is not None and not flown.plan_is_stale and not flown.flight_outdated_by
    trained = made_by(flown, "trained")
    text = f"A trained field has replaced the draft: plan and fly again. {OLD} field: {status(flown).text}"
    assert status(trained).html is note and status(trained).text == text
    assert trained.plan_is_stale, "risk and clearance were those in the draft"
    again = landed(trained)
    assert status(again) == status(flown) and not again.plan_is_stale


def test_a_search_that_is_not_possible_says_why(opened: Session) -> None:
    assert "needs a camera picture" in explain_no_search(opened)
    session = landed(opened)
    assert explain_no_search(session) == ""
    assert "running job" in explain_no_search(after(session, m.StartComparison()))

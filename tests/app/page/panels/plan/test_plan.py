"""Numbers of the plan: its risk by value, and in flight those of the plan that is flown."""

from dataclasses import replace
from typing import Any

import numpy as np
import viser

from nerfnav.field.models.voxel import VoxelField
from nerfnav.planner.steps import PlanOutcome
from nerfnav_app.jobs.events import JobFinished, JobResult
from nerfnav_app.page.kit.html import caution, fine, warning
from nerfnav_app.page.kit.theme import CAUTION, HIT, START, readable
from nerfnav_app.page.panels.plan.plan import OLD, OLD_GOAL, PlanCharts, describe, describe_flown
from nerfnav_app.page.panels.status.status import needs_confirmation, status
from nerfnav_app.places.ends import End, EndRole
from nerfnav_app.queries.clearance import ClearanceQuery
from nerfnav_app.queries.query import Resources
from nerfnav_app.state import actions as m
from nerfnav_app.state.job import JobKind
from nerfnav_app.state.session import Session
from tests.app.doubles import flight_step, plan_step
from tests.app.sessions import after, planned, reports


def planned_with(session: Session, **numbers: Any) -> Session:
    """The session after a plan whose job reports these numbers."""
    session = after(session, m.StartPlan())
    summary = {"wall_s": 1.5, **numbers}
    return reports(session, plan_step(session.ends, 1, PlanOutcome.CONVERGED), JobFinished("plan", JobResult(summary)))


def flying(session: Session) -> Session:
    """The session in a flight of three steps."""
    begun = after(planned(session), m.StartFlight())
    return reports(begun, *(flight_step(begun.ends, index) for index in range(3)))


def test_the_status_shows_the_probability_in_its_colour_and_the_bound_is_in_the_table_alone(opened: Session) -> None:
    for risk, format in ((0.004, fine), (0.04, caution), (0.4, warning)):
        session = planned_with(opened, collision_probability=risk, collision_probability_bound=0.46)
        told = status(session)
        assert told.html is format and f"{100 * risk:.1f}"[:1] in told.text and "46 %" not in told.text
        html = describe(session.plan, stale=False, planning=False)
        assert "Bound of Eq. 1" in html and "46 %" in html
    assert readable(HIT) in html, "40 % is red in the table too"


def test_the_charts_name_their_units_and_a_tiny_risk_has_ticks_that_differ(server: viser.ViserServer) -> None:
    charts = PlanCharts(server)
    units = [line.meaning for chart in (charts._clearance, charts._risk) for line in chart._lines]
    assert units == ["clearance [cm]", "bound of Eq. 1 by step [%]"]
    scales = charts._risk._chart.scales
    assert scales is not None
    top = scales["y"]["range"]["max"]["soft"]  # type: ignore[typeddict-item, index]
    ticks = np.linspace(0, top, 6)  # a fifth of the axis, and the page writes three decimals
    assert len({f"{tick:.3f}" for tick in ticks}) == len(ticks)


def test_what_the_views_will_tell_is_in_the_table_and_too_little_is_in_the_status_with_a_remedy(
    opened: Session,
) -> None:
    for blind, color, format in ((0.0, START, fine), (0.001, CAUTION, caution), (0.62, HIT, caution)):
        expected = {"median_m": 0.012, "p95_m": 0.04, "max_m": 0.06, "blind_share": blind}
        session = planned_with(opened, collision_probability=0.001, expected_sigma=expected)
        html, told = describe(session.plan, stale=False, planning=False), status(session)
        assert "Expected sigma" in html and "1.2 cm" in html and readable(color) in html
        way = f"oo little to see on {62 if blind > 0.5 else 1} % of the way"
        assert told.html is format and (way in told.text) is (blind > 0)
        assert (f"T{way}: add texture" in html) is (blind > 0)


def test_a_flight_that_sees_too_little_is_asked_for_in_a_draft_and_not_in_a_trained_field(opened: Session) -> None:
    expected = {"median_m": 0.012, "p95_m": 0.04, "max_m": 0.06, "blind_share": 0.62}
    trained = planned_with(opened, collision_probability=0.001, expected_sigma=expected)
    place = trained.place
    assert place is not None and isinstance(place.field, VoxelField) and after(trained, m.StartFlight()).job is not None
    field = replace(place.field, info=replace(place.field.info, made_by="draft"))
    draft = replace(trained, place=replace(place, field=field))
    asked = after(draft, m.StartFlight())
    assert asked.job is None and needs_confirmation(asked)
    assert "on 62 % of the way: this field is a draft, fly once it is trained. Fly anyway?" in status(asked).text
    assert "draft" in describe(asked.plan, stale=False, planning=False, in_draft=True)
    assert after(asked, m.StartFlight(anyway=True)).job is not None


def test_a_plan_whose_risk_is_not_known_says_nothing_of_it(opened: Session) -> None:
    told = status(planned(opened))
    assert told.html is fine and "risk" not in told.text


def test_a_flight_with_a_high_risk_is_asked_for_and_one_with_a_moderate_risk_is_not(opened: Session) -> None:
    moderate = after(planned_with(opened, collision_probability=0.08), m.StartFlight())
    assert moderate.job is not None and moderate.job.kind is JobKind.FLY
    asked = after(planned_with(opened, collision_probability=0.23), m.StartFlight())
    assert asked.job is None and needs_confirmation(asked)
    assert status(asked).text.startswith("The collision risk is 23 %, high:") and status(asked).html is warning
    assert not needs_confirmation(after(asked, m.Adjust(m.Settings.PLAN, "duration_s", 3.0)))
    flown = after(asked, m.StartFlight(anyway=True))
    assert flown.job is not None and flown.job.first_plan is asked.plan and flown.job.anyway


def test_the_question_outlasts_the_replay_of_a_quick_plan(opened: Session) -> None:
    quick = planned_with(opened, collision_probability=0.23, wall_s=0.01)
    assert needs_confirmation(after(quick, m.StartFlight(), m.Tick(0.5)))


def test_a_flight_that_plans_first_does_not_take_off_unasked_with_a_high_risk(opened: Session) -> None:
    begun = after(opened, m.Adjust(m.Settings.PLAN, "duration_s", 2.0), m.StartFlight())
    ready = reports(begun, plan_step(begun.ends, 1, PlanOutcome.CONVERGED))
    risky, safe = (replace(flight_step(begun.ends, 0), collision_probability=share) for share in (0.3, 0.05))
    asked = reports(ready, risky)
    assert asked.job is None and needs_confirmation(asked)
    assert reports(ready, safe).in_flight


def test_in_flight_the_numbers_are_those_of_the_plan_that_is_flown(opened: Session) -> None:
    session = flying(opened)
    (asked,) = ClearanceQuery.pending(session)
    assert session.place is not None
    known = after(session, m.QueryAnswered(asked, asked.answer(Resources(session.place))))
    html = describe_flown(known)
    assert all(text in html for text in ("Plan of the flight at", "0.2 s", "0.8 s", "Minimum clearance", "Bound of Eq"))
    assert "Minimum clearance" not in describe_flown(session), "it is not measured yet"


def test_a_goal_that_is_moved_in_a_pause_is_said_to_be_without_a_plan_until_the_flight_goes_on(opened: Session) -> None:
    paused = after(flying(opened), m.Pause())
    assert OLD_GOAL not in describe_flown(paused) and OLD_GOAL not in status(paused).text
    moved = after(paused, m.MoveEnd(EndRole.GOAL, End((0.1, 0.6, 0.5))))
    assert OLD_GOAL in describe_flown(moved) and OLD_GOAL in status(moved).text
    on = reports(after(moved, m.Resume()), flight_step(moved.ends, 3))
    assert OLD_GOAL not in status(after(on, m.Pause())).text


def test_after_a_setting_was_changed_the_numbers_are_those_of_the_old_settings(opened: Session) -> None:
    session = flying(opened)
    assert not session.flight_outdated_by
    changed = after(session, m.Adjust(m.Settings.FLIGHT, "position_noise_m", 0.01))
    assert changed.flight_outdated_by and f"{OLD} settings." in describe_flown(changed)
    assert not after(session, m.Adjust(m.Settings.FLIGHT, "pace", 0.5)).flight_outdated_by
    assert not replace(session, flight=replace(session.flight, flown_by=None)).flight_outdated_by  # type: ignore[type-var]

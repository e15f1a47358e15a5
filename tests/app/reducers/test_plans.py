"""Plans that follow what is asked for, and what becomes of those that are not to be flown."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import pytest

from nerfnav.navigation.episode import EpisodeOutcome
from nerfnav.planner.risk.costs import CostWeights
from nerfnav.planner.steps import FLYABLE, PlanOutcome
from nerfnav_app.jobs.events import JobFailed, JobFinished, JobResult
from nerfnav_app.page.layers.plan import PlanStyle, choose_plan_style
from nerfnav_app.page.panels.status.next_step import choose_next_step, find_remedy
from nerfnav_app.page.panels.status.status import needs_confirmation, status
from nerfnav_app.places.ends import End, EndRole, Ends
from nerfnav_app.queries.catalog import pending_queries
from nerfnav_app.queries.end_fit import EndFitQuery
from nerfnav_app.queries.following_plan import FollowingPlanQuery, MoreTimeQuery, SessionPlan, make_plan, plan_request
from nerfnav_app.queries.query import Resources
from nerfnav_app.queries.robot_view import RobotViewQuery
from nerfnav_app.state import actions as m
from nerfnav_app.state.job import JobKind
from nerfnav_app.state.place import Choice
from nerfnav_app.state.plan import AllowTime, DeclineFlight, PlanRecord, RestoreWeights
from nerfnav_app.state.session import Session
from nerfnav_app.state.view import ViewSettings
from tests.app.doubles import flight_step, plan_step
from tests.app.sessions import after, reports
from tests.app.sessions import planned as well_planned

THERE = m.MoveEnd(EndRole.GOAL, End((0.5, -0.5, 0.4)))
FARTHER = m.MoveEnd(EndRole.GOAL, End((0.4, -0.5, 0.4)))


def asked_of(session: Session) -> FollowingPlanQuery:
    """The one plan that the session asks for."""
    (query,) = [query for query in pending_queries(session) if isinstance(query, FollowingPlanQuery)]
    return query


def held(move: m.MoveEnd) -> m.MoveEnd:
    """The same while the hand goes on."""
    return replace(move, held=True)


def ended(session: Session, outcome: PlanOutcome, summary: dict[str, Any] | None = None) -> Session:
    """The session after a plan that ended so."""
    steps = [plan_step(session.ends, 0), plan_step(session.ends, 1, outcome)]
    return reports(after(session, m.StartPlan()), *steps, JobFinished("plan", JobResult(summary or {"wall_s": 1.5})))


def kinds(queries: Iterable[Any]) -> set[type]:
    return {type(query) for query in queries}


def test_a_hand_that_moves_an_end_is_followed_by_drafts_and_nothing_comes_in_between(opened: Session) -> None:
    moving = after(well_planned(opened), held(THERE))
    asked = asked_of(moving)
    assert asked.record.draft and asked.last is moving.plan.latest.motion  # type: ignore[union-attr]
    assert RobotViewQuery not in kinds(pending_queries(moving))
    answer = SessionPlan((plan_step(asked.record.ends, 0, PlanOutcome.CONVERGED),))
    draft = after(moving, m.QueryAnswered(asked, answer))
    assert draft.plan is not None and draft.plan.draft and not draft.plan_is_stale
    assert draft.fresh_plan is None, "nobody has judged it"
    assert FollowingPlanQuery not in kinds(pending_queries(draft)), "it waits for the hand"
    let_go = after(draft, replace(THERE, held=False))
    final = asked_of(let_go)
    assert not final.record.draft
    done = after(let_go, m.QueryAnswered(final, SessionPlan((plan_step(final.record.ends, 0, PlanOutcome.CONVERGED),))))
    assert done.fresh_plan is done.plan is not None and not done.replaying


def test_a_plan_for_slightly_earlier_ends_is_newer_than_what_stands(opened: Session) -> None:
    first = after(well_planned(opened), held(THERE))
    asked = asked_of(first)
    second = after(first, held(FARTHER))
    told = after(second, m.QueryAnswered(asked, SessionPlan((plan_step(asked.record.ends, 0, PlanOutcome.CONVERGED),))))
    assert told.plan is not None and told.plan.ends == first.ends and told.plan_is_stale
    assert choose_plan_style(told) is PlanStyle.WANTED, "it is a moment behind"
    assert asked_of(told).record.ends == second.ends
    assert choose_plan_style(after(told, replace(FARTHER, held=False))) is PlanStyle.STALE


def test_an_answer_from_before_a_job_is_no_plan_of_now(opened: Session) -> None:
    moving = after(well_planned(opened), held(THERE))
    asked = asked_of(moving)
    again = after(moving, m.StartPlan())
    late = m.QueryAnswered(asked, SessionPlan((plan_step(asked.record.ends, 0, PlanOutcome.CONVERGED),)))
    assert after(again, late) is again


def test_a_plan_that_cannot_follow_is_greyed_and_says_why(opened: Session) -> None:
    moving = after(well_planned(opened), held(THERE))
    told = after(moving, m.QueryAnswered(asked_of(moving), SessionPlan(refusal="the goal is in a stone")))
    assert choose_plan_style(told) is PlanStyle.STALE and "The goal is in a stone." in status(told).text


def test_what_was_dragged_away_from_a_flight_is_planned_again(opened: Session) -> None:
    flying = after(well_planned(opened), m.StartFlight())
    steps = [flight_step(flying.ends, 0), flight_step(flying.ends, 8, EpisodeOutcome.REACHED)]
    landed = reports(flying, *steps, JobFinished("fly"))
    assert choose_plan_style(landed) is PlanStyle.HIDDEN and "Arrived after 0.8 s" in status(landed).text
    moving = after(landed, held(THERE))
    assert asked_of(moving).record.draft and choose_plan_style(moving) is PlanStyle.STALE


@pytest.mark.parametrize(
    "change",
    [
        m.Adjust(m.Settings.PLAN, "duration_s", 3.0),
        m.Adjust(m.Settings.WEIGHTS, "collision", 0.5),
        m.Adjust(m.Settings.PLAN, "shortest", False),
    ],
)
def test_another_setting_is_planned_for_and_nothing_else_is_flown_meanwhile(opened: Session, change: m.Adjust) -> None:
    session = after(well_planned(opened), change)
    assert session.plan_is_stale and session.fresh_plan is None and choose_plan_style(session) is PlanStyle.STALE
    asked = asked_of(session)
    assert asked.record.settings == session.plan_settings and not asked.record.draft
    assert choose_next_step(session)[0] == m.StartPlan()


def test_a_plan_that_was_asked_for_before_undo_does_not_replace_the_one_that_undo_brings_back(opened: Session) -> None:
    first = well_planned(opened)
    moved = after(first, THERE)
    asked = asked_of(moved)
    drawn = after(moved, m.QueryAnswered(asked, SessionPlan((plan_step(asked.record.ends, 0, PlanOutcome.CONVERGED),))))
    moved_on = after(drawn, FARTHER)
    late = asked_of(moved_on)
    answer = SessionPlan((plan_step(late.record.ends, 0, PlanOutcome.CONVERGED),))
    back = after(moved_on, m.Undo(), m.Undo(), m.QueryAnswered(late, answer))
    assert back.plan is not None and back.plan.latest is not None and first.plan is not None
    assert first.plan.latest is back.plan.latest and not back.plan_is_stale


def test_a_slow_planner_does_not_follow_but_says_that_its_plan_is_missing(opened: Session) -> None:
    session = after(well_planned(opened), m.Choose(replace(opened.choice, planner="paper")))
    assert FollowingPlanQuery not in kinds(pending_queries(session))
    assert choose_plan_style(session) is PlanStyle.STALE and "plan again" in status(session).text


@pytest.mark.parametrize("outcome", [one for one in PlanOutcome if one not in FLYABLE])
def test_a_plan_that_is_not_safe_is_drawn_as_such_or_not_at_all_and_says_so_once(
    opened: Session, outcome: PlanOutcome
) -> None:
    session = ended(opened, outcome)
    nowhere = outcome in (PlanOutcome.NO_PATH, PlanOutcome.TIME_LIMIT, PlanOutcome.DIVERGED)
    assert choose_plan_style(session) is (PlanStyle.HIDDEN if nowhere else PlanStyle.UNSAFE)
    assert session.fresh_plan is None and session.notices == opened.notices
    assert len(status(session).text) > 20 and status(session).html("x") != status(opened).html("x")


def test_flying_a_plan_that_is_not_safe_asks_first(opened: Session) -> None:
    session = after(ended(opened, PlanOutcome.LIKELY_COLLISION), m.StartFlight())
    assert session.job is None and needs_confirmation(session)
    assert not needs_confirmation(after(session, DeclineFlight())) and not needs_confirmation(after(session, THERE))
    flying = after(session, m.StartFlight(anyway=True))
    assert flying.job is not None and flying.job.first_plan is session.plan and not needs_confirmation(flying)


def test_a_flight_whose_own_first_plan_is_not_safe_does_not_take_off_unasked(opened: Session) -> None:
    flying = after(opened, m.Adjust(m.Settings.PLAN, "duration_s", 2.0), m.StartFlight())
    session = reports(flying, plan_step(flying.ends, 0), plan_step(flying.ends, 1, PlanOutcome.IN_COLLISION))
    assert session.job is None and session.flight is None and needs_confirmation(session)
    unasked = after(session, m.StartFlight(anyway=True))
    assert reports(unasked, plan_step(flying.ends, 1, PlanOutcome.IN_COLLISION)).job is not None


def test_a_flight_that_took_a_guess_for_its_duration_finds_one_that_is_enough_before_it_takes_off(
    opened: Session,
) -> None:
    assert opened.plan_settings.shortest
    flying = after(opened, m.StartFlight())
    planning = reports(flying, plan_step(flying.ends, 0, PlanOutcome.OVER_LIMITS))
    assert planning.job is not None and planning.job.kind is JobKind.PLAN and planning.flight is None
    good = reports(planning, plan_step(flying.ends, 0, PlanOutcome.CONVERGED), JobFinished("plan"))
    assert good.job is not None and good.job.kind is JobKind.FLY and good.job.first_plan is good.plan
    bad = reports(planning, plan_step(flying.ends, 0, PlanOutcome.OVER_LIMITS), JobFinished("plan"))
    assert bad.job is None and needs_confirmation(bad)


def test_too_fast_is_said_with_the_time_that_is_enough_and_a_button_that_allows_it(opened: Session) -> None:
    session = ended(after(opened, m.Adjust(m.Settings.PLAN, "duration_s", 0.8)), PlanOutcome.OVER_LIMITS)
    assert status(session).text == "Too fast for 0.8 s: allow more time."
    (asked,) = [query for query in pending_queries(session) if isinstance(query, MoreTimeQuery)]
    assert session.place is not None
    seconds = asked.answer(Resources(session.place))
    assert seconds is not None and 0.8 < seconds < 4
    told = after(session, m.QueryAnswered(asked, seconds))
    assert status(told).text == f"Too fast for 0.8 s: allow {seconds:.1f} s."
    assert find_remedy(told) == (AllowTime(seconds), f"Allow {seconds:.1f} s") == choose_next_step(told)
    allowed = after(told, AllowTime(seconds))
    assert allowed.plan_settings.duration_s == seconds and not allowed.plan_settings.shortest
    assert allowed.job is not None and allowed.job.kind is JobKind.PLAN
    made = make_plan(plan_request(allowed.new_plan(allowed.ends), Resources(session.place)), session.place)
    assert made.steps[-1].outcome in FLYABLE


def test_weights_that_lead_through_something_are_restored_by_a_button(opened: Session) -> None:
    light = after(opened, m.Adjust(m.Settings.WEIGHTS, "collision", 0.0))
    session = ended(light, PlanOutcome.IN_COLLISION)
    assert find_remedy(session) == (RestoreWeights(), "Restore the weights")
    restored = after(session, RestoreWeights())
    assert restored.plan_settings.weights == CostWeights() and restored.job is not None


def test_reset_forgets_plan_and_flight_and_every_setting_and_stops_the_job(opened: Session) -> None:
    session = after(
        well_planned(opened), m.MoveEnd(EndRole.START, End((0.3, 0.7, 0.3))),
        m.Adjust(m.Settings.WEIGHTS, "collision", 0.0), m.Adjust(m.Settings.FLIGHT, "seed", 7),
        m.Adjust(m.Settings.VIEW, "opacity", 0.5), m.Choose(replace(opened.choice, planner="paper")),
        m.StartFlight(), m.Reset(),
    )  # fmt: skip
    assert session.plan is None and session.flight is None and session.job is None
    assert session.plan_settings == opened.plan_settings and session.flight_settings == opened.flight_settings
    assert session.view_settings == ViewSettings() and session.choice == Choice() and session.ends == opened.ends


def test_an_error_is_said_once_and_is_gone_with_its_cause(opened: Session) -> None:
    bad = m.Adjust(m.Settings.PLAN, "duration_s", -1.0)
    told = after(opened, bad)
    assert told.trouble is not None and told.trouble.title in status(told).text
    assert after(told, bad, bad).notices == told.notices
    assert after(told, m.Adjust(m.Settings.PLAN, "duration_s", 3.0)).trouble is None
    failed = reports(after(opened, m.StartPlan()), JobFailed("plan", "the goal is in a stone"))
    assert failed.trouble is not None and after(failed, THERE).trouble is None


def test_drafts_from_place_to_place_end_as_good_as_a_plan_from_scratch(opened: Session) -> None:
    place, settings, last = opened.place, opened.plan_settings.with_duration(2.0), None
    assert place is not None
    ways = [Ends(End((-0.7, 0.5, 0.5)), End((0.7, -0.5 + 0.05 * share, 0.5))) for share in range(9)]
    for ends in ways:
        request = plan_request(PlanRecord(ends, settings=settings), Resources(place))
        (last,) = make_plan(replace(request, draft=True, warm_start=last and last.motion), place).steps
        assert last.outcome in FLYABLE
    scratch = make_plan(plan_request(PlanRecord(ways[-1], settings=settings), Resources(place)), place)
    assert last is not None and last.cost.total < 1.1 * scratch.steps[-1].cost.total
    assert EndFitQuery in kinds(pending_queries(after(opened, THERE)))

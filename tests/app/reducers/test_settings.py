"""Plans otherwise, and planners side by side."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from nerfnav.planner.risk.costs import CostWeights
from nerfnav.planner.solvers.fast import FastPlanConfig
from nerfnav_app.jobs.events import JobFinished, PlannerCompared, PlannerResult
from nerfnav_app.jobs.plan import compare_planners as compare
from nerfnav_app.jobs.plan.plan import PlanRequest
from nerfnav_app.page.panels.plan.plan import chart_data, describe
from nerfnav_app.page.panels.plan.planner_comparison import describe_comparison
from nerfnav_app.places.ends import End, Ends
from nerfnav_app.queries.catalog import pending_queries
from nerfnav_app.queries.clearance import Clearance, ClearanceQuery, ShownMotion
from nerfnav_app.queries.query import Resources
from nerfnav_app.reducers.root import reduce
from nerfnav_app.state import actions as m
from nerfnav_app.state.job import JobKind
from nerfnav_app.state.plan import CostHistory, EndComparison, HighlightPlanner, PlanSettings
from nerfnav_app.state.session import Session
from nerfnav_app.worker.backend import NavigationBackend
from tests.app.doubles import balls_place, plan_step
from tests.app.following import followed, result_of
from tests.app.sessions import after, planned, reports

PLACE = balls_place()
FROM, TO = (-0.7, 0.5, 0.5), (0.7, -0.5, 0.5)


@pytest.mark.parametrize(
    ("settings", "name", "bad"),
    [
        (m.Settings.PLAN, "duration_s", math.nan),
        (m.Settings.PLAN, "duration_s", 1e9),
        (m.Settings.WEIGHTS, "collision", -1.0),
        (m.Settings.WEIGHTS, "samples_per_step", 0),
        (m.Settings.WEIGHTS, "margin", math.inf),
    ],
)
def test_numbers_that_make_no_sense_are_refused_with_a_notice(
    opened: Session, settings: m.Settings, name: str, bad: float
) -> None:
    told = after(opened, m.Adjust(settings, name, bad))
    for record in ("plan_settings", "flight_settings", "view_settings"):
        assert getattr(told, record) == getattr(opened, record)
    assert told.trouble is not None and told.trouble.title == "Not applied"


def test_two_numbers_that_are_changed_at_once_are_both_changed(opened: Session) -> None:
    heavy = m.Adjust(m.Settings.WEIGHTS, "collision", 5.0)
    told = after(opened, heavy, m.Adjust(m.Settings.PLAN, "duration_s", 3.0))
    assert told.plan_settings == PlanSettings(3.0, weights=CostWeights(collision=5.0))


def test_weights_reach_the_planner_and_untouched_ones_leave_its_own_settings() -> None:
    own = FastPlanConfig()
    assert PlanSettings().config("fast", None) is None
    assert PlanSettings().config("fast", own) is own
    heavy = PlanSettings(weights=CostWeights(collision=7.0))
    config = heavy.config("minsnap", None)
    assert config is not None and config.weights.collision == 7.0


def test_the_session_plans_for_the_duration_that_was_asked_for(opened: Session) -> None:
    slow = after(opened, m.Adjust(m.Settings.PLAN, "duration_s", 3.0), m.StartPlan())
    assert slow.job is not None and slow.place is not None
    last = result_of(NavigationBackend().begin(slow, slow.job))
    assert last.summary["duration_s"] == pytest.approx(3.0)


def test_a_comparison_runs_each_planner_and_says_why_one_refuses() -> None:
    routes = [PlanRequest(Ends(End(FROM), End(TO)), planner=name) for name in ("fast", "minsnap")]
    refused = PlanRequest(Ends(End((0.0, 0.0, 0.3)), End(TO)), planner="fast")
    events, finished = followed(compare.run([*routes, refused], PLACE))
    comparison = [event.result for event in events if isinstance(event, PlannerCompared)]
    assert [result.planner for result in comparison] == ["fast", "minsnap", "fast"]
    assert comparison[0].motion is not None and comparison[0].summary["cost"]["total"] > 0
    assert comparison[2].motion is None and "occupied" in comparison[2].complaint
    assert finished.summary == {"planners": 3}
    text = describe_comparison(tuple(comparison[:2]))
    assert "minsnap" in text and "–" in text, "no mesh, no overlap"


def test_rivals_are_collected_and_forgotten_when_a_new_plan_begins(opened: Session) -> None:
    session = after(planned(opened), m.StartComparison())
    assert session.job is not None and session.job.kind is JobKind.COMPARE
    session = reports(session, PlannerCompared(PlannerResult("rrt", None, {}, "no way")), JobFinished("compare"))
    assert [result.planner for result in session.comparison] == ["rrt"] and session.job is None
    assert session.plan is not None, "the plan that is flown stays"
    assert after(session, m.StartPlan()).comparison == ()


def test_the_comparison_is_a_table_with_units_whose_rows_can_be_picked() -> None:
    cost = {"collision": 0.0014, "control": 5.48}
    found = PlannerResult("fast", plan_step(Ends(), 0).motion, {
        "cost": cost, "mesh_overlap_m3": None, "duration_s": 0.9, "wall_s": 0.5, "outcome": "too_risky",
    })  # fmt: skip
    html = describe_comparison((found, PlannerResult("rrt", None, {}, "no way")), "fast", "some-widget")
    heads = re.findall(r"<th.*?>(.*?)</th>", html)
    assert [re.sub("<[^>]*>", " ", head).split()[0] for head in heads[:6]] == [
        "Planner", "Collision", "Control", "Overlap", "Flight", "Solve",
    ]  # fmt: skip
    assert html.count("[J]") == 2 and "[cm³]" in html and html.count("[s]") == 2
    assert 'data-pick="some-widget" data-value="fast"' in html and 'class="picked"' in html
    assert "too risky" in html and "no way" in html


def test_compared_planners_hide_the_flight_until_they_are_taken_away(opened: Session) -> None:
    session = after(planned(opened), m.StartComparison())
    assert session.compares_planners
    session = reports(session, PlannerCompared(PlannerResult("rrt", None, {}, "no way")), JobFinished("compare"))
    chosen = after(session, HighlightPlanner("rrt"))
    assert chosen.compares_planners and chosen.highlighted == "rrt"
    ended = after(chosen, EndComparison())
    assert not ended.compares_planners and ended.highlighted is None and ended.plan is session.plan


def test_the_page_asks_once_how_near_a_finished_plan_comes(opened: Session) -> None:
    session = planned(opened)
    (asked,) = [query for query in pending_queries(session) if isinstance(query, ClearanceQuery)]
    known = reduce(session, m.QueryAnswered(asked, Clearance(np.zeros((3, 8)))))
    assert asked not in pending_queries(known)


def test_a_profile_has_clearance_and_bound_of_each_step() -> None:
    events = compare.run([PlanRequest(Ends(End(FROM), End(TO)), steps=10)], PLACE)
    (result,) = [event.result for event in events if isinstance(event, PlannerCompared)]
    assert result.motion is not None
    time, clearance, bound = ClearanceQuery(ShownMotion(result.motion)).answer(Resources(PLACE)).rows
    assert np.allclose(time, 0.1 * np.arange(1, 11))
    assert clearance.min() == pytest.approx(100 * result.summary["safety"]["min_clearance_m"], abs=0.2)
    assert bound.max() == pytest.approx(100 * result.summary["safety"]["bound_per_step_max"], rel=1e-3, abs=1e-6)


def test_limits_are_told_with_their_units_and_violated_ones_marked(opened: Session) -> None:
    session = planned(opened)
    use = {"least": 1.0, "most": 7.0, "lower": None, "upper": 6.0, "unit": "N", "violated": True}
    assert session.plan is not None
    told = describe(replace(session.plan, summary={"limits": {"thrust": use}}), stale=False, planning=False)
    assert "Thrust" in told and "7 N, at most 6 ✗" in told


def test_an_empty_history_draws_nothing() -> None:
    assert chart_data(CostHistory()).shape == (5, 0)

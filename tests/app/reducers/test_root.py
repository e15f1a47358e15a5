"""The app's logic, without a browser and without threads."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

import nerfnav_scenes as scenes
from nerfnav.navigation import GustStrength
from nerfnav.navigation.episode import EpisodeOutcome
from nerfnav.planner.steps import PlanCost, PlanOutcome
from nerfnav.world.task import Task
from nerfnav_app.jobs.events import JobFailed, JobFinished, JobResult, PlaceOpened, Progress, SurfaceShaped
from nerfnav_app.places.ends import End, EndRole, Ends
from nerfnav_app.places.place import Truth
from nerfnav_app.queries.catalog import pending_queries
from nerfnav_app.queries.end_fit import EndFit, EndFitQuery
from nerfnav_app.queries.field_view import FieldView, FieldViewQuery
from nerfnav_app.queries.robot_view import RobotViewQuery
from nerfnav_app.reducers.root import reduce
from nerfnav_app.state import actions as m
from nerfnav_app.state.alignment import Correction
from nerfnav_app.state.flight import LARGEST_GUST
from nerfnav_app.state.job import JobKind
from nerfnav_app.state.place import Choice
from nerfnav_app.state.plan import CostHistory, PlanRecord
from nerfnav_app.state.session import Session
from nerfnav_app.state.view import CameraMoved, Eye, TabClosed
from nerfnav_app.worker.operator_requests import SessionRequests
from tests.app.doubles import balls_place, filter_step, flight_step, plan_step
from tests.app.sessions import after, planned, reports

EYE = Eye((0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0), 1.0, 1.5)


def test_a_session_begins_by_opening_its_place_and_refuses_commands_until_then() -> None:
    session = Session.opening("balls")
    assert session.job is not None and session.job.kind is JobKind.OPEN
    assert after(session, m.StartPlan(), m.MoveEnd(EndRole.GOAL, End((1, 1, 1)))) == session


def test_opening_shows_progress_then_the_place_with_ends_inside_its_box() -> None:
    session = reports(Session.opening("balls"), Progress("shaping", 0.3))
    assert session.job is not None and session.job.fraction == 0.3
    session = reports(session, PlaceOpened(balls_place()), SurfaceShaped(b"glb"), JobFinished("open"))
    assert session.place is not None and session.surface == b"glb" and session.job is None
    for which in EndRole:
        assert session.place.field.box.contains(session.ends.of(which).state().position)


def test_a_moved_end_stays_inside_the_box_with_its_whole_body(opened: Session) -> None:
    session = after(opened, m.MoveEnd(EndRole.GOAL, End((5.0, 0.2, -3.0), yaw=7.0)))
    assert opened.place is not None
    radius = opened.place.robot.body.radius
    x, y, z = session.ends.goal.position
    assert x == pytest.approx(1 - radius, abs=1e-4) and y == 0.2 and z == pytest.approx(radius, abs=1e-4)
    assert session.ends.goal.yaw == pytest.approx(7.0 - 2 * math.pi)
    assert session.ends.start == opened.ends.start


def test_a_plan_grows_iteration_by_iteration_and_keeps_a_short_trail(opened: Session) -> None:
    session = after(opened, m.StartPlan())
    assert session.job is not None and session.job.kind is JobKind.PLAN and session.job.ends == session.ends
    for iteration in range(300):
        session = reports(session, plan_step(session.ends, iteration))
    assert session.plan is not None and session.plan.latest is not None
    assert session.plan.latest.iteration == 299
    assert len(session.plan.trail) == PlanRecord.TRAIL
    session = reports(
        session, plan_step(session.ends, 300, PlanOutcome.CONVERGED), JobFinished("plan", JobResult({"wall_s": 2.0}))
    )
    assert session.job is None and session.plan is not None
    assert session.plan.outcome is PlanOutcome.CONVERGED and session.plan.summary == {"wall_s": 2.0}


def test_cost_history_is_thinned_but_spans_all_iterations() -> None:
    history = CostHistory()
    for iteration in range(10_000):
        history = history.appended(iteration, PlanCost(1.0 / (iteration + 1), 2.0, 0.0))
    assert len(history.iterations) <= CostHistory.LIMIT
    assert history.iterations[0] == 0 and history.iterations[-1] >= 9_900
    assert set(np.diff(history.iterations)) == {history.stride}
    assert history.costs[-1].collision == pytest.approx(1 / (history.iterations[-1] + 1))


def test_moving_an_end_makes_the_plan_stale_and_unfit_to_be_flown(opened: Session) -> None:
    session = planned(opened)
    assert not session.plan_is_stale and session.fresh_plan is session.plan
    moved = after(session, m.MoveEnd(EndRole.GOAL, End((0.7, -0.5, 0.3))))
    assert moved.plan is session.plan and moved.plan_is_stale and moved.fresh_plan is None
    flying = after(moved, m.StartFlight())
    assert flying.plan is None and flying.job is not None and flying.job.first_plan is None


def test_a_flight_begins_with_the_plan_at_hand_and_collects_its_time_steps(opened: Session) -> None:
    session = after(planned(opened), m.StartFlight())
    assert session.job is not None and session.job.first_plan is session.plan is not None
    ends = session.ends
    session = reports(session, flight_step(ends, 0), plan_step(ends, 3), flight_step(ends, 1))
    assert session.flight is not None and [step.index for step in session.flight.steps] == [0, 1]
    arrived = flight_step(ends, 2, EpisodeOutcome.REACHED)
    session = reports(session, arrived, JobFinished("fly", JobResult({"steps": 2})))
    assert session.flight is not None and session.flight.outcome is EpisodeOutcome.REACHED
    assert session.job is None and session.flight_is_shown


def test_planning_within_a_flight_is_shown_as_the_plan_before_the_first_step_only(opened: Session) -> None:
    session = after(opened, m.StartFlight())
    session = reports(session, plan_step(session.ends, 0), plan_step(session.ends, 1))
    assert session.plan is not None and session.plan.latest is not None and session.plan.latest.iteration == 1
    before = session.plan
    session = reports(session, flight_step(session.ends, 0), plan_step(session.ends, 2))
    assert session.plan is before and session.flight is not None and session.flight.plan is not None


def test_pause_holds_step_grants_one_more_and_resume_lets_go(opened: Session) -> None:
    session = after(opened, m.StartFlight())
    session = reports(session, flight_step(session.ends, 0), flight_step(session.ends, 1))
    paused = after(session, m.Pause())
    assert paused.job is not None and paused.job.paused and paused.job.allowed_steps == 2
    stepped = after(paused, m.StepOnce())
    assert stepped.job is not None and stepped.job.allowed_steps == 3
    resumed = after(stepped, m.Resume())
    assert resumed.job is not None and not resumed.job.paused


def test_cancel_keeps_what_was_computed_and_ignores_late_reports(opened: Session) -> None:
    session = after(opened, m.StartPlan())
    session = reports(session, plan_step(session.ends, 0))
    assert session.job is not None
    number, cancelled = session.job.id, after(session, m.Cancel())
    assert cancelled.job is None and cancelled.plan is session.plan
    assert after(cancelled, m.Reported(number, plan_step(session.ends, 1))) == cancelled
    again = after(cancelled, m.StartPlan())
    assert again.job is not None and again.job.id != number
    assert after(again, m.Reported(number, JobFailed("plan", "late"))) == again


def test_only_one_job_runs_at_a_time(opened: Session) -> None:
    session = after(opened, m.StartPlan())
    twice = after(session, m.StartFlight())
    assert twice.job == session.job and "One thing at a time" in twice.notices[-1].body


def test_a_failed_job_becomes_a_notice_and_the_app_goes_on(opened: Session) -> None:
    session = reports(after(opened, m.StartPlan()), JobFailed("plan", "the goal is in a stone"))
    assert session.job is None and session.notices[-1].bad
    assert session.notices[-1].title == "Could not plan" and session.notices[-1].body == "the goal is in a stone"
    assert after(session, m.StartPlan()).job is not None


def test_the_page_asks_about_ends_and_views_until_it_is_answered(opened: Session) -> None:
    queries = pending_queries(opened)
    assert {type(query) for query in queries} == {EndFitQuery, RobotViewQuery}
    session = opened
    for query in queries:
        result = EndFit(None) if isinstance(query, EndFitQuery) else (np.zeros((2, 2, 3)),)
        session = after(session, m.QueryAnswered(query, result))
    assert pending_queries(session) == ()
    moved = after(session, m.MoveEnd(EndRole.GOAL, End((0.6, -0.6, 0.4))))
    assert {getattr(query, "which", "view") for query in pending_queries(moved)} == {EndRole.GOAL, "view"}


def test_an_answer_about_an_end_that_has_moved_since_is_dropped(opened: Session) -> None:
    late = m.QueryAnswered(EndFitQuery(EndRole.GOAL, End((9, 9, 9))), EndFit("in a stone"))
    assert after(opened, late) == opened


def test_notices_are_numbered_and_only_the_last_few_are_kept(opened: Session) -> None:
    session = after(opened, *(m.Notify("Title", str(number)) for number in range(12)))
    assert [notice.body for notice in session.notices] == ["7", "8", "9", "10", "11"]
    assert [notice.id for notice in session.notices] == [7, 8, 9, 10, 11]


def test_an_unknown_message_is_a_programming_error(opened: Session) -> None:
    with pytest.raises(TypeError, match="no message of type str"):
        reduce(opened, "plan")  # type: ignore[arg-type]


def test_a_task_of_the_scene_sets_both_ends_and_reset_brings_them_back() -> None:
    bare = balls_place()
    tasks = tuple(Task(name, (x, 0.0, 0.4), (-x, 0.0, 0.4)) for name, x in (("wide", 0.8), ("narrow", 0.6)))
    truth = Truth(tasks, lambda: scenes.load("blocks"))
    session = reports(Session.opening("balls"), PlaceOpened(replace(bare, truth=truth)), JobFinished("open"))
    assert session.task == "wide" and session.ends.start.position == (0.8, 0.0, 0.4)
    session = after(session, m.ChooseTask("narrow"))
    assert session.ends == Ends(End((0.6, 0.0, 0.4)), End((-0.6, 0.0, 0.4)))
    assert after(session, m.ChooseTask("no such task")) == session
    moved = after(session, m.MoveEnd(EndRole.GOAL, End((0.0, 0.7, 0.4))))
    assert moved.task is None
    back = after(moved, m.Reset())
    assert back.ends == session.ends and back.task == "narrow"


def test_iterations_within_a_time_step_move_guess_and_plan_until_the_step_is_done(opened: Session) -> None:
    session = after(planned(opened), m.StartFlight())
    session = reports(session, flight_step(session.ends, 0), filter_step(session.ends, 11))
    assert session.flight is not None and session.flight.guess is not None
    filtering = session.flight.doing
    session = reports(session, plan_step(session.ends, 4))
    assert session.flight is not None and filtering and session.flight.doing not in ("", filtering)
    session = reports(session, flight_step(session.ends, 1))
    assert session.flight is not None and session.flight.guess is None and session.flight.doing == ""


def test_a_place_that_cannot_be_opened_leaves_the_one_before_it(opened: Session) -> None:
    session = after(planned(opened), m.OpenPlace("nowhere"))
    assert session.what == "nowhere" and session.place is None and session.job is not None
    session = reports(session, JobFailed("open", "there is no such place"))
    assert session.what == "balls" and session.place is opened.place and session.plan is not None
    assert session.job is None and session.notices[-1].bad and "no such place" in session.notices[-1].body


def test_a_mesh_with_stray_parts_is_opened_without_them_where_the_user_agrees(opened: Session) -> None:
    box = ((-3.0, -2.0, 0.0), (3.0, 2.0, 1.5))
    session = reports(after(opened, m.OpenPlace("room.glb")), JobFailed("open", "room.glb has 12 faces far away", box))
    assert session.trouble is not None and session.trouble.remedy == m.OpenPlace("room.glb", box)
    agreed = after(session, m.OpenPlace("room.glb", box))
    assert agreed.job is not None and (agreed.what, agreed.box, agreed.job.kind) == ("room.glb", box, JobKind.OPEN)
    assert agreed.trouble is None and agreed.before is not None and agreed.before.place is opened.place
    assert after(session, m.OpenPlace("room.glb")).box is None, "a box is for the one file that it was offered for"
    first = reports(Session.opening("room.glb"), JobFailed("open", "it has 12 faces far away", box))
    assert first.trouble is not None and first.trouble.remedy == m.OpenPlace("room.glb", box)
    assert after(first, m.OpenPlace("room.glb", box)).box == box, "the first place has no other to return to"


def test_opening_can_be_given_up_and_a_late_report_of_it_is_ignored(opened: Session) -> None:
    opening = after(opened, m.OpenPlace("nowhere"))
    assert opening.job is not None
    session = after(opening, m.Cancel(), m.Reported(opening.job.id, PlaceOpened(balls_place())))
    assert session.what == "balls" and session.place is opened.place
    assert after(session, m.StartPlan()).job != opening.job


def test_a_second_place_forgets_the_first_only_once_it_is_open(opened: Session) -> None:
    session = reports(after(planned(opened), m.OpenPlace("other")), PlaceOpened(balls_place()), JobFinished("open"))
    assert session.what == "other" and session.plan is None and session.place is not opened.place
    again = after(session, m.OpenPlace("third"))
    assert again.before is not None and again.before.what == "other" and again.before.before is None


def test_plans_and_flights_do_not_wait_for_kernels_but_for_the_surface() -> None:
    opening = reports(Session.opening("balls"), PlaceOpened(balls_place()), Progress("shaping", 0.3))
    assert not opening.may_begin, "whoever leaves now would never see the place"
    asked = after(opening, m.StartPlan())
    assert asked.job == replace(opening.job, plan_after=True) and asked.notices == opening.notices
    refused = after(opening, m.StartFlight())
    assert refused.job == opening.job and refused.notices[-1].title == "Still busy"
    warming = reports(opening, SurfaceShaped(b"glTF"), Progress("compiling", 0.6))
    for command, kind in ((m.StartPlan(), JobKind.PLAN), (m.StartFlight(), JobKind.FLY)):
        begun = after(warming, command)
        assert begun.job is not None and begun.job.kind is kind and not begun.may_begin
        assert not begun.notices and begun.surface == b"glTF"
        assert warming.job is not None and begun.job.id != warming.job.id


def test_unknown_names_are_refused_with_those_that_exist(opened: Session) -> None:
    wrong = {Choice(robot="whale"): "quadrotor", Choice(planner="guess"): "fast", Choice(estimator="eye"): "paper"}
    for choice, known in wrong.items():
        session = after(opened, m.Choose(choice))
        assert session.choice == opened.choice
        assert session.notices[-1].bad and known in session.notices[-1].body


def test_another_planner_keeps_the_plan(opened: Session) -> None:
    session = after(planned(opened), m.Choose(replace(opened.choice, planner="paper")))
    assert session.choice.planner == "paper" and session.plan is not None


def quickly_planned(session: Session) -> Session:
    """The session after a plan that took no time at all."""
    steps = [plan_step(session.ends, index) for index in range(3)]
    last = plan_step(session.ends, 3, PlanOutcome.CONVERGED)
    return reports(after(session, m.StartPlan()), *steps, last, JobFinished("plan", JobResult({"wall_s": 0.03})))


def test_a_plan_that_was_made_in_an_instant_is_shown_again_slowly(opened: Session) -> None:
    session = quickly_planned(opened)
    shown = []
    while session.replaying:
        assert session.plan is not None and session.plan.shown is not None and len(shown) < 100
        shown.append(session.plan.shown.iteration)
        session = after(session, m.Tick(0.25))
    assert shown == [0, 0, 1, 1, 2, 2, 3, 3]
    assert session.plan is not None and session.plan.shown is session.plan.latest
    assert not planned(opened).replaying, "a plan that took long was watched while it was made"


def test_the_pace_counts_at_once_and_noise_from_the_next_flight_on(opened: Session) -> None:
    flying = after(planned(opened), m.StartFlight(), m.Adjust(m.Settings.FLIGHT, "pace", 1.0))
    flying = after(flying, m.Adjust(m.Settings.FLIGHT, "position_noise_m", 0.0))
    assert flying.job is not None and flying.job.pace == 1.0
    assert flying.flight_settings.noise.position_m == 0.0


def test_a_gust_is_for_a_flight_under_way(opened: Session) -> None:
    refused = after(opened, m.Gust())
    assert refused.notices[-1].body.startswith("There is no flight to push") and refused.trouble is None
    flying = after(planned(opened), m.StartFlight(), m.Gust(), m.Gust())
    assert flying.job is not None and flying.job.gusts == 2


def test_a_gust_for_which_there_is_no_clearance_or_no_time_left_is_refused_in_a_sentence(opened: Session) -> None:
    flying = after(planned(opened), m.StartFlight(), m.Gust())
    steps = [flight_step(flying.ends, 0), replace(flight_step(flying.ends, 1), gust_mps=0.0)]
    refused = reports(flying, *steps)
    assert refused.notices[-1].body.startswith("The robot has no clearance here")
    assert refused.flight is not None and refused.flight.gusts == ()
    pushed = reports(flying, steps[0], replace(steps[1], gust_mps=0.1), JobFinished("fly"))
    assert pushed.flight is not None and pushed.flight.gusts == (1,) and not pushed.notices
    late = reports(flying, steps[0], JobFinished("fly"))
    assert late.notices[-1].body.startswith("There is no flight to push")


def test_a_goal_dragged_in_flight_is_flown_to_once_the_robot_fits_there(opened: Session) -> None:
    flying = after(planned(opened), m.StartFlight())
    assert flying.job is not None and flying.flight is not None
    assert flying.place is not None
    requests = SessionRequests(flying.job, flying.place)
    there = End((0.4, -0.4, 0.4))
    dragged = after(flying, m.MoveEnd(EndRole.GOAL, there))
    requests.follow(dragged)
    assert torch.equal(requests.take().goal.position, opened.ends.goal.state().position)  # type: ignore[union-attr]
    assert dragged.flight is not None and not dragged.flight_is_stale
    free = after(dragged, m.QueryAnswered(EndFitQuery(EndRole.GOAL, there), EndFit(None)))
    requests.follow(free)
    assert torch.equal(requests.take().goal.position, there.state().position)  # type: ignore[union-attr]


def test_each_gust_is_felt_once(opened: Session) -> None:
    flying = after(planned(opened), m.StartFlight())
    assert flying.job is not None
    assert flying.place is not None
    requests = SessionRequests(flying.job, flying.place)
    requests.follow(after(flying, m.Gust()))
    assert requests.take().gust is None, "the flight has not begun"
    requests.follow(reports(after(flying, m.Gust()), flight_step(flying.ends, 0)))
    first, *later = [requests.take().gust for _ in range(3)]
    assert isinstance(first, GustStrength) and 0 < first.velocity_mps <= LARGEST_GUST.velocity_mps
    assert later == [None, None]


def test_where_other_first_guesses_have_led_stays_visible_beside_the_best(opened: Session) -> None:
    ends = opened.ends
    steps = [replace(plan_step(ends, number), start_index=start) for number, start in enumerate((0, 0, 1, 2))]
    record = PlanRecord(ends)
    for step in (*steps, replace(plan_step(ends, 4, PlanOutcome.CONVERGED), start_index=1)):
        record = record.with_step(step)
    assert record.others == (steps[1].motion, steps[3].motion)


def test_what_was_rendered_for_a_closed_tab_is_forgotten(opened: Session) -> None:
    here, there = (FieldViewQuery(client, EYE, 240, Correction()) for client in (1, 2))
    seen = FieldView(np.zeros((2, 2, 3), np.uint8), np.zeros((2, 2)))
    both = after(opened, *(CameraMoved(query.client, EYE) for query in (here, there)))
    both = after(both, *(m.QueryAnswered(query, seen) for query in (here, there)))
    left = after(both, TabClosed(1))
    assert set(left.eyes) == {2} and not here.is_answered(left) and there.is_answered(left)
    assert after(left, m.QueryAnswered(here, seen)).results == left.results, "nobody looks from there any more"

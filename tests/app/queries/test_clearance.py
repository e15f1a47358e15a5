"""Clearance of the motion that is shown: of the plan, or of that in flight."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from nerfnav.estimator import FilterConfig
from nerfnav.field import UnknownSpace
from nerfnav.navigation import NavigateConfig
from nerfnav.navigation.episode import EpisodeOutcome
from nerfnav.obstacles import ConstantVelocity, Obstacle, ObstacleSet, Sphere
from nerfnav.planner import OccupancyConfig
from nerfnav.planner.risk.tracking_error import tracking_deviations
from nerfnav_app.jobs.events import JobFinished
from nerfnav_app.places.derived import expect_noise_in
from nerfnav_app.places.obstacles import place_obstacles
from nerfnav_app.queries.clearance import ClearanceQuery, deviations_along, find_shown_motion
from nerfnav_app.queries.query import Resources
from nerfnav_app.state import actions as m
from nerfnav_app.state.plan import PlanSettings
from nerfnav_app.state.runs import Scrub
from nerfnav_app.state.session import Session
from tests.app.doubles import balls_place, flight_step
from tests.app.sessions import after, planned, reports

PLACE = balls_place()


def asked_in(session: Session) -> ClearanceQuery:
    """The one query that the session wants."""
    (asked,) = ClearanceQuery.pending(session)
    return asked


def flown(session: Session, steps: int = 3) -> Session:
    """The session in a flight of a few steps."""
    begun = after(planned(session), m.StartFlight())
    return reports(begun, *(flight_step(begun.ends, index) for index in range(steps)))


def test_clearance_of_a_plan_is_asked_for_once_and_not_while_a_hand_drags(opened: Session) -> None:
    session = planned(opened)
    asked = asked_in(session)
    assert session.plan is not None and session.plan.latest is not None
    assert asked.shown.motion is session.plan.latest.motion and asked.shown.begins_s == 0 and asked.pause == 0
    known = after(session, m.QueryAnswered(asked, asked.answer(Resources(PLACE))))
    assert asked_in(known).is_answered(known) and ClearanceQuery.result_shown(known) is not None
    assert list(ClearanceQuery.pending(replace(session, held=True))) == []


def test_announced_movers_count_at_the_time_of_each_step(opened: Session) -> None:
    asked = asked_in(planned(opened))
    alone = asked.answer(Resources(PLACE)).rows
    motion, among = asked.shown.motion, []
    for step in (2, 6):  # it is where the robot is then, and fast
        there = motion.states.position[step] - torch.tensor([0.0, 0.0, 6.0 * step * motion.dt])
        comes = Obstacle("ball", Sphere(0.02), tuple(there.tolist()), motion=ConstantVelocity((0.0, 0.0, 6.0)))
        among.append(asked.answer(Resources(place_obstacles(PLACE, ObstacleSet((comes,))))).rows)
        hit = among[-1][1] == 0
        assert step - 1 in np.flatnonzero(hit) and (among[-1][2][hit] >= 100).all()
    assert (among[0][1] <= alone[1]).all() and among[0][1, 6] == alone[1, 6] and among[1][1, 1] == alone[1, 1]
    unseen = place_obstacles(PLACE, ObstacleSet((replace(comes, seen=True),)))
    np.testing.assert_array_equal(asked.answer(Resources(unseen)).rows, alone)


def test_in_flight_the_motion_is_what_is_left_of_the_plan_from_now_on(opened: Session) -> None:
    session = flown(opened)
    asked = asked_in(session)
    assert session.flight is not None and asked.shown.motion is session.flight.steps[-1].plan
    assert asked.shown.flown and asked.shown.begins_s == pytest.approx(0.2)
    assert asked.pause > 0, "the next step waits for it"
    paused = asked_in(after(session, m.Pause()))
    assert paused.shown.motion is asked.shown.motion and paused.pause == 0 and paused != asked, "then in full"
    rough, rows = (query.answer(Resources(PLACE)).rows for query in (asked, paused))
    assert rough.shape == rows.shape == (3, 8) and rows[0, 0] == pytest.approx(0.3)
    assert (rough[1] <= rows[1] + 1e-4).all() and rough[1].min() == pytest.approx(rows[1].min(), abs=1e-3)
    np.testing.assert_array_equal(rough[2], rows[2])


def test_in_flight_the_clearance_of_a_moment_ago_stays_in_sight_and_that_of_the_plan_does_not(opened: Session) -> None:
    before = planned(opened)
    of_plan = asked_in(before)
    before = after(before, m.QueryAnswered(of_plan, of_plan.answer(Resources(PLACE))))
    session = flown(opened)
    session = replace(session, results=before.results)
    assert ClearanceQuery.result_shown(session) is None
    asked = asked_in(session)
    known = after(session, m.QueryAnswered(asked, asked.answer(Resources(PLACE))))
    later = reports(known, flight_step(known.ends, 3))
    assert ClearanceQuery.result_shown(later) is ClearanceQuery.result_shown(known) is not None
    landed = reports(later, flight_step(known.ends, 8, EpisodeOutcome.REACHED), JobFinished("fly"))
    assert ClearanceQuery.result_shown(landed) is None, "it is of another step"
    assert not asked_in(landed).is_answered(landed)


def test_the_timeline_shows_the_motion_of_its_time(opened: Session) -> None:
    session = flown(opened)
    landed = reports(session, flight_step(session.ends, 8, EpisodeOutcome.REACHED), JobFinished("fly"))
    shown = find_shown_motion(after(landed, Scrub(1)))
    assert landed.flight is not None and shown is not None and shown.motion is landed.flight.steps[1].plan


def test_room_for_noise_is_that_of_the_tracking_error_and_the_paper_keeps_none(opened: Session) -> None:
    session = planned(opened)
    asked = asked_in(session)
    motion = asked.shown.motion
    config = NavigateConfig(FilterConfig().for_field(PLACE.field.info), session.flight_settings.noise)
    height = motion.states.position[0, 2].item()
    noise = expect_noise_in(PLACE, config, "paper", UnknownSpace.OCCUPIED, OccupancyConfig(), height)
    assert noise.estimate.position_m > 0.01, "three balls tell more than they can"
    known = tracking_deviations(PLACE.robot, motion.dt, noise)
    deviations = asked.answer(Resources(PLACE)).deviations
    assert deviations is not None and deviations.shape == (9, 2)
    np.testing.assert_allclose(deviations, deviations_along(motion, PLACE.robot, noise))
    np.testing.assert_allclose(deviations[1], [known[0].level, known[0].height])
    np.testing.assert_allclose(deviations[-1], [known[-1].level, known[-1].height])
    alone = replace(session, plan_settings=PlanSettings(paper_cost=True))
    assert asked_in(replace(alone, plan=replace(session.plan, settings=alone.plan_settings))).context is None  # type: ignore[arg-type]


def test_the_bound_of_a_motion_is_that_of_all_its_steps_and_at_most_one(opened: Session) -> None:
    clearance = asked_in(planned(opened)).answer(Resources(PLACE))
    assert clearance.bound == pytest.approx(min(1.0, 0.01 * clearance.rows[2].sum()))
    assert clearance.smallest_m == pytest.approx(0.01 * clearance.rows[1].min())

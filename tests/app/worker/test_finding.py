"""Robots that are carried away and looked for, as the session has it."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.estimator.relocalize.global_localization import RelocaliseOutcome, RelocaliseResult, RelocaliseStep
from nerfnav.geometry.camera import FORWARD_MOUNT, Pose
from nerfnav.navigation.episode import EpisodeOutcome
from nerfnav.navigation.supervisor import SupervisorAction
from nerfnav.planner.space.ends import fits
from nerfnav.robots.state import RigidState
from nerfnav_app.jobs.events import JobFinished, JobResult, Progress
from nerfnav_app.jobs.track.localize import find
from nerfnav_app.page.layers.global_localization import frusta
from nerfnav_app.page.panels.flight import estimate
from nerfnav_app.state import actions as m
from nerfnav_app.state.flight import LocalizationRecord
from nerfnav_app.state.job import JobKind
from nerfnav_app.state.session import Session
from nerfnav_app.text import sentence
from nerfnav_app.worker.backend import NavigationBackend
from nerfnav_app.worker.operator_requests import SessionRequests
from tests.app.doubles import flight_step
from tests.app.sessions import after, planned, reports


def candidates() -> RelocaliseStep:
    """Two places, one of them likely."""
    bodies = RigidState.stack([RigidState.at_rest((0.1, 0.2, 0.3), 0.5), RigidState.at_rest((0.4, 0.2, 0.3))]).pose
    poses = bodies.compose(Pose(FORWARD_MOUNT.rotation, FORWARD_MOUNT.position))
    return RelocaliseStep(1.0, poses, torch.tensor([0.9, 0.1]), torch.tensor([0.02, 0.05]))


def ended(outcome: RelocaliseOutcome | None = RelocaliseOutcome.FOUND) -> LocalizationRecord:
    """A search with these places; None: it goes on."""
    return LocalizationRecord(candidates(), 0, outcome)


def flying(opened: Session, steps: int) -> Session:
    """A session whose flight has taken some time steps."""
    session = after(planned(opened), m.StartFlight())
    return reports(session, *(flight_step(session.ends, index) for index in range(steps)))


def flown(opened: Session) -> Session:
    """A session after a flight of five time steps."""
    session = flying(opened, 5)
    return reports(session, flight_step(session.ends, 5, EpisodeOutcome.REACHED), JobFinished("fly"))


def test_nothing_is_looked_for_before_the_robot_has_seen_something(opened: Session) -> None:
    session = after(opened, m.FindRobot())
    assert session.job is None and session.notices[-1].title == "No picture"
    assert opened.last_picture is None


def test_after_a_flight_the_robot_is_looked_for_by_its_last_picture(opened: Session) -> None:
    session = flown(opened)
    assert session.flight is not None and session.last_picture is session.flight.steps[-1].image
    finding = after(session, m.FindRobot())
    assert finding.job is not None and finding.job.kind is JobKind.FIND
    assert finding.flight is session.flight, "the flight stays in sight"
    found = reports(finding, candidates(), RelocaliseResult(RelocaliseOutcome.FOUND, candidates(), torch.eye(6)))
    assert found.search is not None and found.search.at == 6 and found.search.outcome is RelocaliseOutcome.FOUND
    told = {"outcome": "found", "advice": "one place looks like the picture"}
    done = reports(found, JobFinished("localize", JobResult(told)))
    assert done.job is None and (done.notices[-1].title, done.notices[-1].bad) == ("Found", False)
    lost = reports(found, JobFinished("localize", JobResult({"outcome": "lost", "advice": "no place"})))
    assert (lost.notices[-1].title, lost.notices[-1].bad) == ("Not found", True)


def test_a_new_flight_forgets_what_was_found(opened: Session) -> None:
    done = JobFinished("localize", JobResult({"outcome": "ambiguous", "advice": "several places"}))
    session = reports(after(flown(opened), m.FindRobot()), candidates(), done)
    assert session.search is not None
    assert after(session, m.StartFlight()).search is None
    assert after(session, m.Reset()).search is None


def test_what_was_found_is_in_sight_near_the_time_of_its_picture() -> None:
    search = LocalizationRecord(candidates(), at=10)
    assert [search.is_visible_at(steps) for steps in (5, 6, 10, 14, 15)] == [False, True, True, True, False]


def test_carrying_and_finding_are_counted_in_flight_and_each_reaches_the_flight_once(opened: Session) -> None:
    session = flying(opened, 3)
    assert session.in_flight and session.job is not None and session.place is not None
    helm = SessionRequests(session.job, session.place)
    asked = after(session, m.KidnapRobot(), m.FindRobot(), m.Gust())
    assert asked.job is not None and (asked.job.kidnaps, asked.job.searches, asked.job.gusts) == (1, 1, 1)
    helm.follow(asked)
    first, second = helm.take(), helm.take()
    assert first.search and first.kidnap_pose is not None and first.gust is not None
    assert not second.search and second.kidnap_pose is None and second.gust is None
    assert after(opened, m.KidnapRobot()) is opened, "there is nobody to carry"


@pytest.mark.parametrize("seed", range(4))
def test_the_robot_is_carried_to_where_it_fits_not_far_from_where_it_is(opened: Session, seed: int) -> None:
    session = flying(opened, 4)
    assert session.job is not None and session.place is not None and session.flight is not None
    job, place = replace(session.job, id=session.job.id), session.place
    helm = SessionRequests(job, place)
    for _ in range(seed):
        helm.take()
    helm.follow(after(session, *[m.KidnapRobot()] * (seed + 1)))
    carried, truth = helm.take().kidnap_pose, session.flight.steps[-1].truth
    assert carried is not None and 0.5 <= (carried.position - truth.position).norm() < 1.1
    there = replace(truth, position=carried.position, rotation=carried.rotation)
    assert fits(place.field, place.robot.body, there)


def test_the_worker_looks_for_the_robot_in_the_picture_that_the_session_has(opened: Session) -> None:
    session = after(flown(opened), m.FindRobot())
    assert session.job is not None
    events = NavigationBackend(runs=None).begin(session, session.job)
    with pytest.raises(InvalidInputError, match="pictures of 200 x 200 x 3"):  # the picture of these tests is smaller
        list(events)


def test_the_first_search_says_how_far_it_has_looked_around_and_may_be_left(opened: Session) -> None:
    assert opened.place is not None
    camera = opened.place.robot.camera
    events = find(opened.place, torch.zeros(camera.height, camera.width, 3, dtype=torch.uint8))
    told = [event for event, _ in zip(events, range(4), strict=False) if isinstance(event, Progress)]
    assert {event.label for event in told} == {"looking around in the field"}
    shares = [event.fraction for event in told]
    assert shares == sorted(set(shares)) and len(shares) == 4 and shares[-1] < 1
    events.close()


def test_the_panel_tells_where_the_robot_may_be_and_how_likely_that_is() -> None:
    html = estimate.describe_candidates(ended())
    for text in (sentence(RelocaliseOutcome.FOUND.value), "0.10, 0.20, 0.30", "90 %", "29°"):
        assert text in html
    assert str(len(candidates().weights)) in estimate.describe_candidates(ended(None))
    ambiguous = estimate.describe_candidates(ended(RelocaliseOutcome.AMBIGUOUS))
    assert sentence(RelocaliseOutcome.AMBIGUOUS.value) in ambiguous


def test_the_panel_says_what_a_robot_does_that_does_not_know_where_it_is(opened: Session) -> None:
    session = flying(opened, 3)
    assert session.flight is not None
    doubting = replace(flight_step(session.ends, 3), recovery=SupervisorAction.WIDENED)
    assert "and the robot holds" in estimate.describe(session.flight.with_step(doubting))


def test_a_frustum_begins_at_the_camera_and_opens_where_it_looks() -> None:
    pose = RigidState.at_rest((0.1, 0.2, 0.3), 0.0).pose.compose(FORWARD_MOUNT)
    lines = frusta(Pose(pose.rotation[None], pose.position[None]))
    assert lines.shape == (8, 2, 3)
    np.testing.assert_allclose(lines[:4, 0], np.broadcast_to([0.1, 0.2, 0.3], (4, 3)), atol=1e-6)
    np.testing.assert_allclose(lines[:, 1, 0], 0.25, atol=1e-6)
    assert np.ptp(lines[4:, 0, 1]) == pytest.approx(0.3, abs=1e-5)


def test_where_no_place_looks_like_the_picture_none_is_called_likely() -> None:
    html = estimate.describe_candidates(ended(RelocaliseOutcome.LOST))
    assert sentence(RelocaliseOutcome.LOST.value) in html and "90 %" not in html
    assert "90 %" in estimate.describe_candidates(ended())

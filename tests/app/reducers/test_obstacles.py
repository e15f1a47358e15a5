"""Obstacles of the page: placed by a click, changed, copied, deleted, undone, and kept for the next server."""

from dataclasses import replace
from pathlib import Path

import pytest

from nerfnav.navigation import EpisodeOutcome
from nerfnav.obstacles import MOST, BoxShape, WayPoints
from nerfnav_app.jobs.events import JobFinished, JobResult
from nerfnav_app.page.panels.status.status import status
from nerfnav_app.queries.click_landing import ClickLandingQuery
from nerfnav_app.queries.following_plan import FollowingPlanQuery
from nerfnav_app.queries.placed_obstacles import ObstacleLandingQuery, WayPointQuery
from nerfnav_app.state import actions as m
from nerfnav_app.state import obstacles as o
from nerfnav_app.state.alignment import Ray
from nerfnav_app.state.runs import Scrub
from nerfnav_app.state.session import Session
from nerfnav_app.worker.session_memory import SessionMemory
from tests.app.doubles import flight_step
from tests.app.sessions import after, planned, reports

RAY = Ray((0.0, 0.0, 2.0), (0.0, 0.0, -1.0))
BOX = o.new_obstacle(o.ObstacleKind.BOX, "box 1", 0.2, (0.1, 0.2, 0.3))


def with_box(session: Session) -> Session:
    """The session after a box was placed by a click."""
    session = after(session, m.AimEnd(o.ObstacleKind.BOX), m.ClickScene(RAY))
    assert list(ClickLandingQuery.pending(session)) == []
    (asked,) = ObstacleLandingQuery.pending(session)
    return after(session, m.QueryAnswered(asked, BOX))


def test_a_click_places_an_obstacle_and_undo_takes_it_away(opened: Session) -> None:
    session = with_box(opened)
    assert session.obstacles == (BOX,) and session.chosen_obstacle is BOX and session.clicked is None
    assert session.aiming is None, "the next click places nothing"
    undone = after(session, m.Undo())
    assert undone.obstacles == () and after(undone, m.Redo()).obstacles == (BOX,)


def test_a_click_that_meets_nothing_places_nothing_and_says_so(opened: Session) -> None:
    session = after(opened, m.AimEnd(o.ObstacleKind.SPHERE), m.ClickScene(RAY))
    (asked,) = ObstacleLandingQuery.pending(session)
    missed = after(session, m.QueryAnswered(asked, "The click met nothing."))
    assert missed.obstacles == () and missed.notices[-1].body == "The click met nothing."


def test_a_drag_is_one_step_to_undo(opened: Session) -> None:
    session = with_box(opened)
    for x in (0.2, 0.3, 0.4):
        session = after(session, o.ChangeObstacle("box 1", BOX.changed(position=(x, 0, 0.3)), held=True))
        assert session.held
    session = after(session, o.ChangeObstacle("box 1", BOX.changed(position=(0.5, 0, 0.3))))
    assert not session.held and session.obstacles[0].entry.position == (0.5, 0, 0.3)
    session = after(session, o.ChangeObstacle("box 1", BOX.changed(position=(0.6, 0, 0.3)), held=True))
    back = after(session, m.Undo())
    assert back.obstacles[0].entry.position == (0.5, 0, 0.3)
    assert after(back, m.Undo()).obstacles == (BOX,)


def test_obstacles_are_renamed_copied_hidden_and_deleted(opened: Session) -> None:
    session = after(with_box(opened), o.ChangeObstacle("box 1", BOX.changed(name=" crate ")))
    assert session.chosen == "crate" and session.obstacles[0].name == "crate"
    session = after(session, o.CopyObstacle("crate"))
    first, second = session.obstacles
    assert second.name == "crate 1" and session.chosen == "crate 1"
    assert second.entry.position[0] > first.entry.position[0] + 0.2, "one stands in the other"
    session = after(session, o.ChangeObstacle("crate", replace(first, hidden=True)))
    assert [placed.name for placed in session.visible_obstacles] == ["crate 1"]
    session = after(session, o.DeleteObstacle("crate 1"), o.DeleteObstacle("nobody"), o.CopyObstacle("nobody"))
    assert [placed.name for placed in session.obstacles] == ["crate"] and session.chosen_obstacle is None


@pytest.mark.parametrize(
    ("name", "reason"), [("box 2", "another obstacle is named 'box 2'"), (" ", "a name has letters")]
)
def test_names_that_cannot_be_are_one_sentence(name: str, reason: str, opened: Session) -> None:
    session = after(with_box(opened), o.CopyObstacle("box 1"))
    refused = after(session, o.ChangeObstacle("box 1", BOX.changed(name=name)))
    assert refused.obstacles == session.obstacles
    assert refused.notices[-1].bad and reason.lower() in refused.notices[-1].body.lower()


def test_too_many_obstacles_are_one_sentence(opened: Session) -> None:
    many = tuple(BOX.changed(name=f"box {number}") for number in range(MOST))
    full = replace(opened, obstacles=many)
    refused = after(full, o.CopyObstacle("box 1"))
    assert refused.obstacles == many and f"There are {MOST} obstacles already" in refused.notices[-1].body


def test_sizes_of_shapes_follow_their_corner() -> None:
    assert BOX.scaled((0.3, -0.2, 0.0)).obstacle.shape == BoxShape((0.6, 0.4, 0.005))
    ball = o.new_obstacle(o.ObstacleKind.SPHERE, "ball", 0.2, (0, 0, 0))
    assert ball.scaled((0.1, 0.3, 0.1)).entry.sphere == 0.3
    post = o.new_obstacle(o.ObstacleKind.CYLINDER, "post", 0.2, (0, 0, 0)).scaled((0.1, 0.05, 0.4)).entry.cylinder
    assert post is not None and (post.radius, post.height) == (0.05, 0.8)


def test_a_reset_takes_obstacles_away_and_undo_brings_them_back(opened: Session) -> None:
    reset = after(with_box(opened), m.Reset())
    assert reset.obstacles == () and after(reset, m.Undo()).obstacles == (BOX,)


def test_the_next_server_opens_with_the_obstacles(opened: Session, tmp_path: Path) -> None:
    session = replace(with_box(opened), what="balls")
    SessionMemory(tmp_path, "balls").follow(session)
    kept = SessionMemory(tmp_path, "balls").last()
    assert kept is not None and kept.moment.obstacles == (BOX,)


def test_a_file_gives_obstacles_with_their_motions(tmp_path: Path) -> None:
    path = tmp_path / "some.yaml"
    path.write_text("obstacles: [{sphere: 0.1}, {name: post, cylinder: {radius: 0.1, height: 1}}]")
    assert [placed.name for placed in o.read_placed(path)] == ["obstacle 1", "post"]
    path.write_text("obstacles: [{name: a, sphere: 0.1, motion: {velocity: [1, 0, 0]}}]")
    (moving,) = o.read_placed(path)
    assert moving.moves and moving.path is None and not moving.may_have_path, "only way points can be drawn"


def drawn(session: Session, *points: tuple[float, float, float]) -> Session:
    """The session after clicks drew way points for its chosen obstacle."""
    session = after(session, m.AimEnd(o.PathPoint.NEXT))
    for point in points:
        session = after(session, m.ClickScene(RAY))
        (asked,) = WayPointQuery.pending(session)
        session = after(session, m.QueryAnswered(asked, point))
    return session


def test_clicks_draw_a_path_until_it_ends_and_each_is_undone(opened: Session) -> None:
    session = drawn(with_box(opened), (0.4, 0.2, 0.3), (0.4, -0.5, 0.3))
    path = session.obstacles[0].path
    assert path is not None and path.points == [(0, 0, 0), (0.3, 0, 0), (0.3, -0.7, 0)]
    assert (path.speed, path.closed) == (o.SPEED, True) and session.drawing is session.obstacles[0]
    assert not list(FollowingPlanQuery.pending(planned(session))), "it plans between two clicks"
    assert "Esc ends its path" in status(session).text
    ended = after(session, m.AimEnd(None))
    assert ended.drawing is None and after(ended, m.ClickScene(RAY)).clicked is None
    once = after(ended, m.Undo()).obstacles[0].path
    assert once is not None and len(once.points) == 2
    stands = after(ended, m.Undo(), m.Undo())
    assert stands.obstacles == (BOX,) and after(stands, m.Redo(), m.Redo()).obstacles == ended.obstacles


def test_a_path_has_a_pace_is_copied_and_removed(opened: Session) -> None:
    session = after(drawn(with_box(opened), (0.4, 0.2, 0.3)), o.ChangePace("box 1", 1.5, False))
    assert session.obstacles[0].obstacle.motion == WayPoints(((0, 0, 0), (0.3, 0, 0)), 1.5)
    copied = after(session, o.CopyObstacle("box 1"))
    assert copied.obstacles[1].path == session.obstacles[0].path and copied.drawing is None, "clicks draw on"
    still = after(session, o.RemoveMotion("box 1"))
    assert still.obstacles == (BOX,) and after(still, m.Undo()).obstacles == session.obstacles


@pytest.mark.parametrize("speed", [0.0, -1.0, 1e6])
def test_absurd_speeds_are_one_sentence(speed: float, opened: Session) -> None:
    session = drawn(with_box(opened), (0.4, 0.2, 0.3))
    refused = after(session, o.ChangePace("box 1", speed, True))
    assert refused.obstacles == session.obstacles
    assert f"from 0.01 to 50 m/s, not {speed:g}." in refused.notices[-1].body and refused.notices[-1].bad


@pytest.mark.parametrize(
    ("point", "reason"),
    [((9.0, 0.2, 0.3), "x 9.00, y 0.20, z 0.30 m lies outside the place"), ((0.1, 0.2, 0.3), "all at one place")],
)
def test_way_points_that_cannot_be_are_one_sentence(
    point: tuple[float, float, float], reason: str, opened: Session
) -> None:
    refused = drawn(with_box(opened), point)
    assert refused.obstacles == (BOX,) and refused.drawing is not None, "the next click draws on"
    assert refused.notices[-1].bad and reason in refused.notices[-1].body


def test_a_path_without_a_click_is_one_sentence(opened: Session) -> None:
    refused = after(with_box(opened), m.AimEnd(o.PathPoint.NEXT), m.AimEnd(None))
    assert refused.obstacles == (BOX,) and "at least one way point" in refused.notices[-1].body


def test_another_choice_ends_a_path_and_clicks_without_an_obstacle_place_nothing(opened: Session) -> None:
    session = drawn(with_box(opened), (0.4, 0.2, 0.3))
    assert after(session, o.ChooseObstacle(None)).aiming is None
    gone = after(session, o.DeleteObstacle("box 1"), m.ClickScene(RAY))
    assert gone.drawing is None and gone.clicked is None and gone.aiming is None


def test_motions_are_played_from_take_off_on_and_put_back(opened: Session) -> None:
    assert after(with_box(opened), o.PlayMotions(True)).motion_time is None, "nothing moves"
    session = drawn(with_box(opened), (0.4, 0.2, 0.3))
    played = after(session, o.PlayMotions(True), m.Tick(0.25), m.Tick(0.5))
    assert played.moves and played.obstacle_time == 0.75 and played.history == session.history
    assert after(played, o.PlayMotions(False)).obstacle_time == 0.0
    flown = after(played, m.StartFlight())
    assert flown.in_flight and flown.motion_time is None and after(flown, o.PlayMotions(True)).motion_time is None


def test_obstacles_are_shown_at_the_time_of_the_flight_and_of_the_timeline(opened: Session) -> None:
    session = after(planned(drawn(with_box(opened), (0.4, 0.2, 0.3))), m.StartFlight())
    session = reports(session, *(flight_step(session.ends, index) for index in range(4)))
    assert session.obstacle_time == pytest.approx(0.3)
    ended = reports(session, flight_step(session.ends, 4, EpisodeOutcome.REACHED), JobFinished("fly", JobResult()))
    assert ended.obstacle_time == pytest.approx(0.4)
    assert after(ended, Scrub(1)).obstacle_time == pytest.approx(0.1)

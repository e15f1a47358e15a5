"""Obstacles of the page: placed by a click, changed, copied, deleted, undone, and kept for the next server."""

from dataclasses import replace
from pathlib import Path

import pytest

from nerfnav.core.errors import InvalidInputError
from nerfnav.obstacles import MOST, BoxShape
from nerfnav_app.queries.click_landing import ClickLandingQuery
from nerfnav_app.queries.placed_obstacles import ObstacleLandingQuery
from nerfnav_app.state import actions as m
from nerfnav_app.state import obstacles as o
from nerfnav_app.state.alignment import Ray
from nerfnav_app.state.session import Session
from nerfnav_app.worker.session_memory import SessionMemory
from tests.app.sessions import after

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
    missed = after(session, m.QueryAnswered(asked, None))
    assert missed.obstacles == () and "met nothing to put the sphere on" in missed.notices[-1].body


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


def test_a_file_gives_obstacles_and_one_that_moves_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "some.yaml"
    path.write_text("obstacles: [{sphere: 0.1}, {name: post, cylinder: {radius: 0.1, height: 1}}]")
    assert [placed.name for placed in o.read_placed(path)] == ["obstacle 1", "post"]
    path.write_text("obstacles: [{name: a, sphere: 0.1, motion: {velocity: [1, 0, 0]}}]")
    with pytest.raises(InvalidInputError, match=r"some.yaml: the obstacle 'a' moves"):
        o.read_placed(path)

"""What a server knows of a place from the last one."""

from dataclasses import replace
from pathlib import Path

from nerfnav.field import UnknownSpace
from nerfnav_app.jobs.events import PlaceOpened
from nerfnav_app.places.ends import End, EndRole
from nerfnav_app.state import actions as m
from nerfnav_app.state.session import Session
from nerfnav_app.state.view import CameraRested
from nerfnav_app.worker.session_memory import SessionMemory
from tests.app.doubles import balls_place
from tests.app.sessions import after, reports

HERE = (1.0, -2.0, 0.5), (0.1, 0.0, 0.3)
THERE = End((0.5, -0.5, 0.4), 0.3)


def changed(session: Session) -> Session:
    """A session in which much was set."""
    return after(
        session,
        m.MoveEnd(EndRole.GOAL, THERE),
        m.Adjust(m.Settings.PLAN, "unknown", UnknownSpace.FREE),
        m.Adjust(m.Settings.WEIGHTS, "collision", 5.0),
        m.Adjust(m.Settings.FLIGHT, "seed", 7),
        m.Adjust(m.Settings.VIEW, "clearance", True),
        m.Choose(replace(session.choice, planner="rrt")),
        CameraRested(HERE),
    )


def test_ends_settings_and_camera_are_as_they_were_left_when_a_server_opens_the_place_again(
    opened: Session, tmp_path: Path
) -> None:
    left = changed(opened)
    SessionMemory(tmp_path, left.what).follow(left)
    again = Session.opening(left.what, saved=SessionMemory(tmp_path, left.what).last())
    there = reports(again, PlaceOpened(balls_place()))
    assert there.view == there.viewed == HERE, "the camera is where it was"
    assert there.moment == left.moment and there.saved is None and not there.history.past
    assert after(there, m.Reset()).ends == opened.ends, "what was found at first is forgotten"


def test_a_camera_that_had_lost_sight_of_the_place_begins_anew(opened: Session, tmp_path: Path) -> None:
    lost = after(changed(opened), CameraRested(((9.0, 9.0, 9.0), (20.0, 20.0, 9.0))))
    SessionMemory(tmp_path, lost.what).follow(lost)
    again = Session.opening(lost.what, saved=SessionMemory(tmp_path, lost.what).last())
    there = reports(again, PlaceOpened(balls_place()))
    assert there.view is None and there.viewed is None
    assert there.moment == lost.moment, "all else is as it was left"


def test_another_place_knows_nothing_and_what_cannot_be_read_is_no_memory(opened: Session, tmp_path: Path) -> None:
    SessionMemory(tmp_path, opened.what).follow(changed(opened))
    assert SessionMemory(tmp_path, "elsewhere").last() is None
    (file,) = tmp_path.iterdir()
    file.write_text('{"choice": 3}')
    assert SessionMemory(tmp_path, opened.what).last() is None


def test_a_hand_that_holds_an_end_is_waited_for(opened: Session, tmp_path: Path) -> None:
    memory = SessionMemory(tmp_path, opened.what)
    memory.follow(after(opened, m.MoveEnd(EndRole.GOAL, THERE, held=True)))
    assert not list(tmp_path.iterdir())

"""What the session makes of a person who puts the place right."""

from pathlib import Path

import pytest

from nerfnav.importers.alignment import AlignmentRequest
from nerfnav_app.jobs.events import JobFinished, JobResult, PlaceOpened
from nerfnav_app.queries.surface_point import SurfacePointQuery
from nerfnav_app.reducers.root import reduce
from nerfnav_app.state import actions as m
from nerfnav_app.state import alignment as p
from nerfnav_app.state.job import JobKind
from nerfnav_app.state.session import Session
from tests.app.doubles import balls_place
from tests.app.sessions import after, reports


@pytest.fixture
def opened() -> Session:
    """A place without ground truth, open."""
    return reports(Session.opening("balls"), PlaceOpened(balls_place()), JobFinished("open"))


def clicked(session: Session, *points: p.Vector) -> Session:
    """The session after clicks that met these points from two metres above."""
    for x, y, z in points:
        session = after(session, m.ClickScene(p.Ray((x, y, z + 2.0), (0.0, 0.0, -1.0))))
        (query,) = SurfacePointQuery.pending(session)
        session = reduce(session, m.QueryAnswered(query, (x, y, z)))
    return session


def test_two_clicks_and_a_distance_ask_for_a_scale(opened: Session) -> None:
    session = clicked(after(opened, p.PickPoints(p.PickTarget.DISTANCE)), (0.0, 0.0, 0.0), (0.3, 0.4, 0.0))
    assert session.alignment.pointing is None and session.alignment.length == pytest.approx(0.5)
    refused = after(session, p.ApplyAlignment())
    assert refused.job is None and refused.notices[-1].bad
    session = after(session, p.SetDistance(2.0))
    assert session.alignment.request().factor == pytest.approx(4.0)
    begun = after(session, p.ApplyAlignment())
    assert begun.job is not None and begun.job.kind is JobKind.PLACE


def test_three_clicks_are_a_floor_seen_from_above(opened: Session) -> None:
    asked = after(opened, p.PickPoints(p.PickTarget.FLOOR))
    session = clicked(asked, (0.0, 0.0, 0.1), (1.0, 0.0, 0.1), (0.0, 1.0, 0.1))
    correction = session.alignment.request()
    assert correction.floor is not None and correction.up is not None and correction.up[2] == pytest.approx(2.0)


def test_three_clicks_on_a_line_are_told_when_they_are_applied(opened: Session) -> None:
    asked = after(opened, p.PickPoints(p.PickTarget.FLOOR))
    session = after(clicked(asked, (0.0, 0.0, 0.1), (1.0, 0.0, 0.1), (2.0, 0.0, 0.1)), p.ApplyAlignment())
    assert session.job is None and "on one line" in session.notices[-1].body


def test_a_click_that_meets_nothing_is_asked_again(opened: Session) -> None:
    session = after(opened, p.PickPoints(p.PickTarget.FLOOR), m.ClickScene(p.Ray((0.0, 0.0, 2.0), (0.0, 0.0, 1.0))))
    (query,) = SurfacePointQuery.pending(session)
    session = reduce(session, m.QueryAnswered(query, None))
    assert session.alignment.pointing is p.PickTarget.FLOOR and not session.alignment.floor and session.notices[-1].bad


def test_nothing_asked_for_changes_nothing(opened: Session) -> None:
    session = after(opened, p.ApplyAlignment())
    assert session.job is None and session.notices[-1].title == "Nothing to change"
    assert after(opened, p.UndoAlignment()).job is None


def test_what_was_put_right_is_opened_and_can_be_undone(opened: Session) -> None:
    begun = after(opened, p.Keep(((0.0, 0.0, 0.0), (0.5, 0.5, 0.5))), p.ApplyAlignment())
    assert begun.alignment.request() == AlignmentRequest(kept=((0.0, 0.0, 0.0), (0.5, 0.5, 0.5)))
    result = JobResult({"changed": ["what is kept: less"]}, (Path("folder") / "balls.npz",))
    session = reports(begun, JobFinished("place", result))
    assert session.what == str(Path("folder") / "balls.npz") and session.alignment.undo == ("balls",)
    assert session.job is not None and session.job.kind is JobKind.OPEN and "less" in session.notices[-1].body
    session = reports(session, PlaceOpened(balls_place()), JobFinished("open"))
    undone = after(session, p.UndoAlignment())
    assert undone.what == "balls" and undone.alignment == p.AlignmentDraft()
    other = after(session, m.OpenPlace("stonehenge"))
    assert other.alignment == p.AlignmentDraft()  # of another place nothing is known

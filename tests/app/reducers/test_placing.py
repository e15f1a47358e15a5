"""What the session makes of a person who puts the place right."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from nerfnav.field.models.analytic import BallsField
from nerfnav.geometry import so3
from nerfnav.geometry.box import Box
from nerfnav_app.jobs.events import JobFinished, JobResult, PlaceOpened
from nerfnav_app.places.ends import EndRole
from nerfnav_app.places.place import Place
from nerfnav_app.places.vantage import is_visible
from nerfnav_app.queries.query import Resources
from nerfnav_app.queries.surface_point import FloorQuery, SurfacePointQuery
from nerfnav_app.reducers.root import reduce
from nerfnav_app.state import actions as m
from nerfnav_app.state import alignment as p
from nerfnav_app.state.job import JobKind
from nerfnav_app.state.session import Session
from nerfnav_app.state.view import TabClosed
from tests.app.doubles import balls_place, voxels_of
from tests.app.sessions import after, reports
from tests.field.moves import room

BOX = balls_place().field.box
MIDDLE: p.Vector = (0.0, 0.0, 0.4)
"""Of that box [m]."""


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


def where(session: Session, *points: p.Vector) -> np.ndarray:
    """Where points of the place are shown."""
    return np.array([session.alignment.now.point_after(point) for point in points])


def about(axis: p.Vector, degrees: float) -> tuple[float, float, float, float]:
    """The quaternion of a turn."""
    half = math.radians(degrees) / 2
    x, y, z = (math.sin(half) * part for part in axis)
    return math.cos(half), x, y, z


def test_two_clicks_and_a_distance_scale_the_place_and_the_points_stay_on_it(opened: Session) -> None:
    session = clicked(after(opened, p.PickPoints(p.PickTarget.DISTANCE)), (0.0, 0.0, 0.0), (0.3, 0.4, 0.0))
    assert session.alignment.pointing is None and session.alignment.length == pytest.approx(0.5)
    assert not session.alignment.now.is_moved
    session = after(session, p.SetDistance(2.0))
    assert session.alignment.now.similarity.scale == pytest.approx(4.0)
    assert session.alignment.length == pytest.approx(2.0) and session.view != opened.view
    np.testing.assert_allclose(where(session, (0.3, 0.4, 0.0))[0], session.alignment.picked[1], atol=1e-6)
    begun = after(session, p.ApplyAlignment())
    assert begun.job is not None and begun.job.kind is JobKind.PLACE
    refused = after(session, p.SetDistance(0.0))
    assert refused.alignment.now == session.alignment.now and refused.notices[-1].bad


def test_a_typed_scale_is_that_of_the_whole_correction_and_takes_the_crop_box_along(opened: Session) -> None:
    session = after(opened, p.Crop(((-0.5, -0.5, 0.0), (0.5, 0.5, 0.5))), p.SetScale(0.5), p.SetScale(2.0))
    assert session.alignment.now.similarity.scale == pytest.approx(2.0)
    assert session.alignment.now.crop == ((-1.0, -1.0, 0.0), (1.0, 1.0, 1.0))
    for wrong in (0.0, -1.0, math.inf, math.nan):
        refused = after(session, p.SetScale(wrong))
        assert refused.alignment.now == session.alignment.now and "scale" in refused.notices[-1].body


def test_three_clicks_of_a_wall_make_it_the_floor_at_once(opened: Session) -> None:
    asked = after(opened, p.PickPoints(p.PickTarget.FLOOR))
    wall: tuple[p.Vector, ...] = ((-1.0, -1.0, 0.0), (-1.0, 1.0, 0.0), (-1.0, 0.0, 0.8))
    session = asked
    for point in wall:  # from inside
        session = after(session, m.ClickScene(p.Ray((1.0, 0.0, 0.4), (-1.0, 0.0, 0.0))))
        (query,) = SurfacePointQuery.pending(session)
        session = reduce(session, m.QueryAnswered(query, point))
    assert session.alignment.pointing is None and not session.alignment.picked
    np.testing.assert_allclose(where(session, *wall)[:, 2], 0, atol=1e-6)
    assert where(session, MIDDLE)[0, 2] == pytest.approx(1.0)
    assert session.alignment.now.similarity.axes is not None, "a quarter turn keeps its nodes"


def test_three_clicks_on_a_line_are_refused(opened: Session) -> None:
    asked = after(opened, p.PickPoints(p.PickTarget.FLOOR))
    session = clicked(asked, (0.0, 0.0, 0.1), (1.0, 0.0, 0.1), (2.0, 0.0, 0.1))
    assert not session.alignment.now.is_moved and "on one line" in session.notices[-1].body
    assert session.alignment.pointing is None and session.alignment.clicked is None


def test_a_click_that_meets_nothing_is_asked_again(opened: Session) -> None:
    session = after(opened, p.PickPoints(p.PickTarget.FLOOR), m.ClickScene(p.Ray((0.0, 0.0, 2.0), (0.0, 0.0, 1.0))))
    (query,) = SurfacePointQuery.pending(session)
    session = reduce(session, m.QueryAnswered(query, None))
    assert session.alignment.pointing is p.PickTarget.FLOOR and not session.alignment.picked and session.notices[-1].bad


def test_a_click_meets_the_place_where_it_is_shown(opened: Session) -> None:
    assert opened.place is not None
    session = after(opened, p.QuarterTurn(p.Axis.X), p.SetScale(3.0), p.PickPoints(p.PickTarget.DISTANCE))
    ball = where(session, (0.5, 0.4, 0.2))[0]  # of radius 0.15
    above = np.array([0.0, 0.0, 1.0])
    eye = ball + 3 * above
    query = SurfacePointQuery(p.Ray(tuple(eye.tolist()), (0.0, 0.0, -1.0)), session.alignment.now)
    met = query.answer(Resources(opened.place))
    assert met is not None
    np.testing.assert_allclose(met, ball + 3 * 0.15 * above, atol=0.2)


def test_a_hand_that_turns_the_place_makes_one_step_and_does_not_move_the_camera(opened: Session) -> None:
    up: p.Vector = (0.0, 0.0, 1.0)
    session = after(opened, p.ShowGizmo(True))
    for degrees in (5.0, 10.0, 20.0):
        session = after(session, p.PosePlace(about(up, degrees), (0.1, 0.0, 0.4), held=True))
    session = after(session, p.PosePlace(about(up, 30.0), (0.2, 0.0, 0.4)))
    assert len(session.alignment.past) == 1 and session.view == opened.view
    np.testing.assert_allclose(where(session, MIDDLE)[0], (0.2, 0.0, 0.4), atol=1e-6)
    turned = where(session, (1.0, 0.0, 0.4))[0] - where(session, MIDDLE)[0]
    np.testing.assert_allclose(turned, (math.cos(math.radians(30)), 0.5, 0.0), atol=1e-6)
    again = after(session, p.PosePlace(about(up, 40.0), (0.2, 0.0, 0.4), held=True))
    assert len(again.alignment.past) == 2, "the next drag is another step"
    closed = after(again, TabClosed(1), p.PosePlace(about(up, 50.0), (0.2, 0.0, 0.4)))
    assert len(closed.alignment.past) == 3, "a tab that is closed holds nothing any more"
    back = after(session, m.Undo())
    assert back.alignment.now == p.Correction() and back.alignment.by_hand and not back.history.future


@pytest.mark.parametrize("axis", p.Axis)
def test_quarter_turns_are_exact_turn_about_the_middle_and_four_of_them_turn_back(
    opened: Session, axis: p.Axis
) -> None:
    session = after(opened, p.QuarterTurn(axis))
    turn = so3.exp(0.5 * math.pi * torch.eye(3).double()[list(p.Axis).index(axis)])
    np.testing.assert_allclose(session.alignment.now.similarity.rotation, turn, atol=1e-12)
    np.testing.assert_allclose(where(session, MIDDLE)[0], MIDDLE, atol=1e-6)
    box = session.alignment.now.box(BOX)
    assert session.view is not None and is_visible(session.view, box.lower.tolist(), box.upper.tolist())
    for _ in range(3):
        session = after(session, p.QuarterTurn(axis))
    np.testing.assert_allclose(where(session, (1.0, 2.0, 3.0))[0], (1.0, 2.0, 3.0), atol=1e-5)


@pytest.mark.parametrize("degrees", [89.5, 90.4])
def test_what_is_nearly_a_quarter_turn_becomes_one(opened: Session, degrees: float) -> None:
    session = after(opened, p.PosePlace(about((1.0, 0.0, 0.0), degrees), MIDDLE))
    assert session.alignment.now == after(opened, p.QuarterTurn(p.Axis.X)).alignment.now
    far = after(opened, p.PosePlace(about((1.0, 0.0, 0.0), degrees + 2), MIDDLE))
    assert far.alignment.now.similarity.axes is None


def test_the_floor_is_found_in_a_place_that_was_turned(opened: Session) -> None:
    assert opened.place is not None
    there = replace(opened, place=replace(opened.place, field=room()))
    assert there.place is not None
    tilted = about((1.0, 0.0, 0.0), 20.0)
    session = after(there, p.PosePlace(tilted, (0.0, 0.0, 3.0)), p.FindFloor())
    (query,) = FloorQuery.pending(session)
    session = reduce(session, m.QueryAnswered(query, query.answer(Resources(there.place))))
    assert not session.alignment.finding and not list(FloorQuery.pending(session))
    np.testing.assert_allclose(where(session, (-0.3, -0.3, 0.0), (0.3, -0.3, 0.0))[:, 2], 0, atol=0.06)
    up = session.alignment.now.similarity.rotation[2]
    assert float(up[2]) == pytest.approx(1.0, abs=0.01)


def test_a_place_without_a_floor_says_so(opened: Session) -> None:
    empty = voxels_of(BallsField(Box.of((-1, -1, 1), (1, 1, 2)), torch.zeros(1, 3), torch.tensor([0.1])), 0.1)
    assert opened.place is not None
    session = after(opened, p.FindFloor())
    (query,) = FloorQuery.pending(session)
    answer = query.answer(Resources(Place("empty", empty, None, opened.place.robot)))
    session = reduce(session, m.QueryAnswered(query, answer))
    assert session.notices[-1].title == "No floor" and not session.alignment.now.is_moved


def test_a_crop_box_keeps_its_corners_apart(opened: Session) -> None:
    session = after(opened, p.Crop(((0.5, 0.0, 0.0), (0.0, 1.0, 0.5))))
    crop = session.alignment.now.crop
    assert crop is not None and all(low < high for low, high in zip(*crop, strict=True))
    assert after(session, p.Crop(None)).alignment.now == p.Correction()


def test_nothing_asked_for_changes_nothing(opened: Session) -> None:
    session = after(opened, p.ApplyAlignment())
    assert session.job is None and session.notices[-1].title == "Nothing to change"
    assert after(opened, p.UndoAlignment()).job is None


def test_plans_wait_until_the_place_is_where_it_belongs(opened: Session) -> None:
    ready = replace(opened, seeking=False)
    session = after(ready, p.QuarterTurn(p.Axis.X))
    for command in (m.StartPlan(), m.StartFlight(), m.AimEnd(EndRole.GOAL)):
        refused = after(session, command)
        assert refused.job is None and refused.aiming is None and "apply or cancel" in refused.notices[-1].body
    cancelled = after(session, p.DiscardAlignment())
    assert cancelled.alignment == p.AlignmentDraft()
    assert after(cancelled, m.StartPlan()).job is not None


def test_what_was_put_right_is_opened_and_can_be_undone(opened: Session) -> None:
    crop = ((0.0, 0.0, 0.0), (0.5, 0.5, 0.5))
    begun = after(opened, p.QuarterTurn(p.Axis.X), p.Crop(crop), p.ApplyAlignment())
    request = begun.alignment.now.request()
    assert request.box == crop and request.moved is not None and request.answered == ("box", "up")
    assert after(begun, p.QuarterTurn(p.Axis.X)).alignment == begun.alignment, "a hand came too late"
    result = JobResult({"changed": ["what is kept: less"]}, (Path("folder") / "balls.npz",))
    session = reports(begun, JobFinished("place", result))
    assert session.what == str(Path("folder") / "balls.npz") and session.alignment.undo == ("balls",)
    assert session.job is not None and session.job.kind is JobKind.OPEN and "less" in session.notices[-1].body
    session = reports(session, PlaceOpened(balls_place()), JobFinished("open"))
    undone = after(session, p.UndoAlignment())
    assert undone.what == "balls" and undone.alignment == p.AlignmentDraft()
    other = after(session, m.OpenPlace("stonehenge"))
    assert other.alignment == p.AlignmentDraft()  # of another place nothing is known

"""What panel and scene show of a place that is put right by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest
import viser

from nerfnav.field.core.info import FieldInfo
from nerfnav_app.jobs.events import JobFinished, PlaceOpened
from nerfnav_app.page.layers.alignment import AlignmentLayer, floor_of, turned_edges
from nerfnav_app.page.panels.place.alignment import AlignmentPanel, describe
from nerfnav_app.page.panels.place.place import describe_doubts
from nerfnav_app.page.panels.status.next_step import NextButtons
from nerfnav_app.page.panels.status.status import status
from nerfnav_app.reducers.root import reduce
from nerfnav_app.state import alignment as p
from nerfnav_app.state.actions import Cancel
from nerfnav_app.state.alignment import Correction
from nerfnav_app.state.session import Session
from nerfnav_app.state.view import to_point
from tests.app.doubles import balls_place
from tests.app.sessions import after, reports

BOX = balls_place().field.box


@pytest.fixture
def opened() -> Session:
    """A place without ground truth, open."""
    return reports(Session.opening("balls"), PlaceOpened(balls_place()), JobFinished("open"))


def test_only_what_can_be_done_can_be_pressed_and_numbers_are_those_of_the_correction(
    server: viser.ViserServer, opened: Session
) -> None:
    panel = AlignmentPanel(server, lambda command: None)
    panel.show(opened)
    assert panel._apply.disabled and panel._undo.disabled and panel._discard.disabled
    assert not panel._distance.visible and not panel._lower.visible
    session = after(opened, p.QuarterTurn(p.Axis.X), p.SetScale(2.0), p.Crop(((0.0, 0.0, 0.0), (1.0, 0.5, 0.25))))
    panel.show(session)
    assert not (panel._apply.disabled or panel._undo.disabled or panel._discard.disabled)
    assert panel._scale.value == pytest.approx(2.0) and "4 m long" in panel._guessed.content
    assert panel._lower.visible and tuple(panel._upper.value) == (1.0, 0.5, 0.25)
    for _ in range(3):
        session = after(session, p.UndoAlignment())
    panel.show(session)
    assert session.alignment.now == Correction() and panel._undo.disabled and panel._scale.value == 1.0


def test_the_status_says_what_is_to_be_done_and_nothing_is_planned_meanwhile(
    server: viser.ViserServer, opened: Session
) -> None:
    session = after(replace(opened, seeking=False), p.ShowGizmo(True))
    buttons = NextButtons(server, lambda command: None)
    buttons.show(session, visible=True)
    assert "apply" in status(session).text
    assert all(button.disabled for button in buttons._buttons.values() if button.visible)
    applied = after(session, p.QuarterTurn(p.Axis.Y), p.ApplyAlignment())
    buttons.show(applied, visible=True)
    assert applied.job is not None and not buttons._buttons[Cancel].disabled, "it cannot be stopped"
    assert "Click point 1 of 3" in describe(after(session, p.PickPoints(p.PickTarget.FLOOR)).alignment)


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("side", range(2))
def test_each_face_of_the_crop_box_moves_along_its_axis_alone(
    server: viser.ViserServer, opened: Session, side: int, axis: int
) -> None:
    posted = []
    layer = AlignmentLayer(server, posted.append)
    before = ((-1.0, -2.0, 0.0), (1.0, 2.0, 3.0))
    layer.show(after(opened, p.Crop(before)))
    face = layer._faces[side, axis]
    assert face._node.active_axes == tuple(index == axis for index in range(3))
    face._node.position = tuple(np.array(face.position) + 0.25)  # whatever the other numbers are
    face._moved(True)
    moved = np.array(before)
    moved[side, axis] += 0.25
    assert posted == [p.Crop((to_point(moved[0]), to_point(moved[1])), held=True)]


def test_handles_are_where_the_place_is_and_gone_while_it_is_applied(
    server: viser.ViserServer, opened: Session
) -> None:
    layer = AlignmentLayer(server, lambda command: None)
    layer.show(opened)
    assert not layer._gizmo._node.visible and not layer._label.visible
    half = math.radians(15)
    pose = p.PosePlace((math.cos(half), 0.0, math.sin(half), 0.0), (1.0, 2.0, 3.0))
    session = after(opened, p.ShowGizmo(True), pose, p.Crop(((0.0, 0.0, 0.0), (2.0, 2.0, 2.0))))
    layer.show(session)
    np.testing.assert_allclose(layer._gizmo._node.position, (1, 2, 3), atol=1e-6)
    np.testing.assert_allclose(abs(layer._gizmo.wxyz @ np.array(pose.wxyz)), 1, atol=1e-6)
    assert all(face._node.visible for face in layer._faces.values())
    assert layer._faces[1, 0].position == (2.0, 1.0, 1.0) and layer._faces[0, 2].position == (1.0, 1.0, 0.0)
    assert not any(frame.visible for frame in layer._of_before)
    applied = reduce(session, p.ApplyAlignment())
    layer.show(applied)
    assert applied.job is not None and not layer._gizmo._node.visible and not layer._faces[0, 0]._node.visible
    layer.show(after(opened, p.DiscardAlignment()))
    assert not layer._label.visible and all(frame.visible for frame in layer._of_before)


def test_the_box_turns_with_the_place_and_the_floor_lies_below_it() -> None:
    now = Correction().turned(p.Axis.X, BOX).scaled(3.0, BOX)
    edges, around = turned_edges(now, BOX), now.box(BOX)
    np.testing.assert_allclose(edges.reshape(-1, 3).min(0), around.lower, atol=1e-5)
    np.testing.assert_allclose(edges.reshape(-1, 3).max(0), around.upper, atol=1e-5)
    floor = floor_of(around)
    assert (floor[..., 2] == 0).all() and (floor.reshape(-1, 3).min(0)[:2] <= around.lower[:2].numpy()).all()
    assert 4 < len(floor) < 60


def test_a_guessed_up_is_offered_to_be_turned() -> None:
    place = balls_place()
    info = FieldInfo(guesses=("up is -y (the habit of its format)",))
    guessed = replace(place, field=replace(place.field, info=info))  # type: ignore[type-var]
    assert "Turn, scale, crop" in describe_doubts(guessed) and "Turn" not in describe_doubts(place)


@pytest.mark.parametrize(
    ("made_by", "is_said"), [("draft", True), ("fused", True), ("trained", False), ("baked", False)]
)
def test_a_draft_is_called_one(made_by: str, is_said: bool) -> None:
    place = balls_place()
    field = replace(place.field, info=FieldInfo(made_by=made_by))  # type: ignore[type-var]
    assert ("is a draft" in describe_doubts(replace(place, field=field))) is is_said

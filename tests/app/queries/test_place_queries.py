"""What the worker tells the page about a place."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from nerfnav.estimator.relocalize.capture_prior import encode_views
from nerfnav.field.core.occupancy import classify_unseen
from nerfnav.field.models.voxel import VoxelField
from nerfnav.geometry import look_at
from nerfnav.planner.space.ends import fits
from nerfnav.robots.state import Motion, RigidState
from nerfnav_app.places.ends import End, EndRole, Ends
from nerfnav_app.places.place import Place
from nerfnav_app.queries.clearance import ClearanceQuery, ShownMotion
from nerfnav_app.queries.click_landing import ClickLandingQuery
from nerfnav_app.queries.density_slice import DensitySliceQuery
from nerfnav_app.queries.end_fit import EndFitQuery
from nerfnav_app.queries.field_view import FieldViewQuery
from nerfnav_app.queries.first_ends import find_view
from nerfnav_app.queries.query import Resources
from nerfnav_app.queries.space import Space, SpaceQuery
from nerfnav_app.state.alignment import Axis, Correction, Ray
from nerfnav_app.state.place import Click
from nerfnav_app.state.view import Eye
from tests.app.doubles import balls_place

PLACE = balls_place()
UNSEEN = slice(6, 16), slice(32, 44), slice(4, 16)
"""Nodes far from all balls that no camera saw, in `partly_seen`."""


def partly_seen() -> tuple[Place, np.ndarray, np.ndarray]:
    """The place with a part that no camera saw, and the lowest and highest corner (3) of that [m]."""
    field = PLACE.field
    assert isinstance(field, VoxelField)
    unseen = torch.zeros(field.shape, dtype=torch.bool)
    unseen[UNSEEN] = True
    corners = np.array([[part.start for part in UNSEEN], [part.stop - 1 for part in UNSEEN]])
    lower, upper = field.box.lower.numpy() + corners * field.spacing.numpy()
    return replace(PLACE, field=replace(field, evidence=classify_unseen(unseen, field.values[..., 0]))), lower, upper


def test_an_end_in_a_ball_is_refused_and_the_offer_is_free() -> None:
    report = EndFitQuery(EndRole.GOAL, End((0.0, 0.0, 0.3))).answer(Resources(PLACE))
    assert report.problem is not None and "the goal is in occupied space" in report.problem
    assert report.offer is not None
    assert fits(PLACE.field, PLACE.robot.body, report.offer.state())
    assert math.dist(report.offer.position, (0.0, 0.0, 0.3)) < 0.5


def test_a_free_end_is_no_problem_and_there_is_no_offer() -> None:
    report = EndFitQuery(EndRole.START, End((-0.7, 0.6, 0.5))).answer(Resources(PLACE))
    assert report.problem is None and report.offer is None


def test_a_click_on_a_ball_puts_the_robot_on_top_of_it() -> None:
    landed = ClickLandingQuery(Click(EndRole.START, Ray((0.0, 0.0, 2.0), (0.0, 0.0, -3.0)))).answer(Resources(PLACE))
    assert landed is not None
    x, y, z = landed
    assert (x, y) == (0.0, 0.0)
    assert 0.5 < z < 0.65, "the ball ends at 0.5 m"


def test_a_click_on_a_side_puts_the_robot_beside_it_where_it_fits() -> None:
    landed = ClickLandingQuery(Click(EndRole.START, Ray((-0.9, 0.0, 0.3), (1.0, 0.0, 0.0)))).answer(Resources(PLACE))
    assert landed is not None
    assert fits(PLACE.field, PLACE.robot.body, End(landed).state())
    assert math.dist(landed, (-0.2, 0.0, 0.3)) < 0.3, "it is far from what was clicked"


def test_a_click_into_the_sky_lands_nowhere() -> None:
    click = Click(EndRole.START, Ray((0.0, 0.0, 2.0), (0.0, 0.0, 1.0)))
    assert ClickLandingQuery(click).answer(Resources(PLACE)) is None


def test_the_field_from_a_tabs_camera_shows_a_ball_in_front_of_it_at_its_distance() -> None:
    # x right, y down, z forward: looks along the world's x from beside the first ball
    wxyz = (0.5, -0.5, 0.5, -0.5)
    eye = Eye((-0.9, 0.0, 0.3), wxyz, math.radians(60), 1.5)
    view = FieldViewQuery(0, eye, 60, Correction()).answer(Resources(PLACE))
    assert view.image.shape == (40, 60, 3) and view.depth.shape == (40, 60)
    assert view.depth[20, 30] == pytest.approx(0.7, abs=0.06)
    assert view.depth[0, 0] > 100, "there is nothing in the corner"


def test_a_field_that_is_turned_and_scaled_is_seen_where_it_is_shown() -> None:
    now = Correction().turned(Axis.Z, PLACE.field.box).scaled(2.0, PLACE.field.box)
    wxyz = (0.5**0.5, -(0.5**0.5), 0.0, 0.0)  # along y, to which x has been turned
    eye = Eye(now.point_after((-0.9, 0.0, 0.3)), wxyz, math.radians(60), 1.5)
    view = FieldViewQuery(0, eye, 60, now).answer(Resources(PLACE))
    assert view.depth[20, 30] == pytest.approx(1.4, abs=0.12)


def test_the_first_view_of_photographs_is_theirs_from_further_back_until_the_ends_are_not_in_it() -> None:
    field = PLACE.field
    assert isinstance(field, VoxelField)
    eyes = torch.tensor([[-1.0, -0.5, 0.4], [-1.0, 0.0, 0.45], [-1.0, 0.5, 0.4]])
    poses = look_at(eyes, torch.tensor([0.0, 0.0, 0.4]).expand(3, 3))
    seen = replace(PLACE, field=replace(field, info=replace(field.info, views=encode_views(poses))))
    near = Ends(End((-0.2, -0.2, 0.6)), End((-0.2, 0.2, 0.6)))
    eye, target = find_view(seen, near)
    np.testing.assert_allclose(target, (0.0, 0.0, 0.4), atol=0.05)
    np.testing.assert_allclose(eye, (-1.4, 0.0, 0.45), atol=0.1)
    apart = Ends(End((-0.9, -0.9, 0.7)), End((-0.9, 0.9, 0.7)))
    assert find_view(seen, apart) == find_view(PLACE, apart) != (eye, target)
    outwards = replace(poses, rotation=poses.rotation @ torch.diag(torch.tensor([-1.0, 1.0, -1.0])))
    blind = replace(PLACE, field=replace(field, info=replace(field.info, views=encode_views(outwards))))
    assert find_view(blind, near) == find_view(PLACE, near)


def test_occupied_space_is_shown_by_its_outside() -> None:
    view = SpaceQuery(Space.OCCUPIED).answer(Resources(PLACE))
    assert view.centers.shape[1] == 3 and len(view.centers) > 50
    distance = np.linalg.norm(view.centers - np.array([0.0, 0.0, 0.3]), axis=1)
    assert distance.min() > 0.1, "the middle of a ball is hidden by what is around it"


def test_a_slice_is_bright_where_the_field_is_dense() -> None:
    image = DensitySliceQuery(0.3 / 0.8).answer(Resources(PLACE))
    rows, columns, channels = image.shape
    assert channels == 4
    middle, corner = image[rows // 2, columns // 2], image[0, 0]
    assert middle[3] > 200 and corner[3] < 80
    assert torch.tensor(middle[:3].astype(int)).sum() > torch.tensor(corner[:3].astype(int)).sum()


def test_space_that_no_camera_saw_is_shown_where_the_field_knows_of_any() -> None:
    asked = SpaceQuery(Space.UNKNOWN)
    assert len(asked.answer(Resources(PLACE)).centers) == 0
    place, lower, upper = partly_seen()
    view = asked.answer(Resources(place))
    assert len(view.centers) > 50
    assert (view.centers >= lower - 1e-5).all() and (view.centers <= upper + 1e-5).all()


def test_what_no_camera_saw_is_occupied_and_near_as_it_is_for_planners() -> None:
    place, lower, upper = partly_seen()
    middle = 0.5 * (lower + upper)
    occupied, as_seen = (SpaceQuery(Space.OCCUPIED).answer(Resources(one)) for one in (place, PLACE))
    near = [(np.abs(view.centers - middle) < 0.6 * (upper - lower)).all(1).sum() for view in (occupied, as_seen)]
    assert near[0] > 50 and near[1] == 0
    states = RigidState.stack([RigidState.at_rest(tuple(middle.tolist()))] * 2)
    motion = Motion(states, torch.zeros(1, 4), 0.1)
    still = ClearanceQuery(ShownMotion(motion))
    (_, inside, _), (_, outside, _) = (still.answer(Resources(one)).rows for one in (place, PLACE))
    assert inside[0] == 0 < outside[0]

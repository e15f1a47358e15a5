"""What the worker tells the page about a place."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from app import sensing
from app.ends import End, Which
from app.look import Eye
from app.place import Place
from app.questions import (
    EndQuestion,
    EyeQuestion,
    PointQuestion,
    ProfileQuestion,
    SliceQuestion,
    Space,
    SpaceQuestion,
)
from nerfnav.field.evidence import states_of_unseen
from nerfnav.field.voxel import VoxelField
from nerfnav.planner.occupancy import OccupancyConfig, body_density
from nerfnav.robots.state import Motion, RigidState
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
    return replace(PLACE, field=replace(field, evidence=states_of_unseen(unseen, field.values[..., 0]))), lower, upper


def test_an_end_in_a_ball_is_refused_and_the_offer_is_free() -> None:
    report = sensing.end_report(PLACE, EndQuestion(Which.GOAL, End((0.0, 0.0, 0.3))))
    assert report.problem is not None and "the goal is in occupied space" in report.problem
    assert report.offer is not None
    density = body_density(PLACE.field, PLACE.robot.body, report.offer.state())
    assert density <= OccupancyConfig().threshold
    assert math.dist(report.offer.position, (0.0, 0.0, 0.3)) < 0.5


def test_a_free_end_is_no_problem_and_there_is_no_offer() -> None:
    report = sensing.end_report(PLACE, EndQuestion(Which.START, End((-0.7, 0.6, 0.5))))
    assert report.problem is None and report.offer is None


def test_a_click_on_a_ball_puts_the_robot_on_top_of_it() -> None:
    landed = sensing.landing(PLACE, PointQuestion(Which.START, (0.0, 0.0, 2.0), (0.0, 0.0, -3.0)))
    assert landed.position is not None
    x, y, z = landed.position
    assert (x, y) == (0.0, 0.0)
    assert 0.5 < z < 0.65, "the ball ends at 0.5 m"


def test_a_click_into_the_sky_lands_nowhere() -> None:
    assert sensing.landing(PLACE, PointQuestion(Which.START, (0.0, 0.0, 2.0), (0.0, 0.0, 1.0))).position is None


def test_the_field_from_a_tabs_camera_shows_a_ball_in_front_of_it_at_its_distance() -> None:
    # x right, y down, z forward: looks along the world's x from beside the first ball
    wxyz = (0.5, -0.5, 0.5, -0.5)
    eye = Eye((-0.9, 0.0, 0.3), wxyz, math.radians(60), 1.5)
    view = sensing.eye_view(PLACE, EyeQuestion(0, eye, 60))
    assert view.image.shape == (40, 60, 3) and view.depth.shape == (40, 60)
    assert view.depth[20, 30] == pytest.approx(0.7, abs=0.06)
    assert view.depth[0, 0] > 100, "there is nothing in the corner"


def test_occupied_space_is_shown_by_its_outside() -> None:
    view = sensing.space_view(PLACE, SpaceQuestion(Space.OCCUPIED))
    assert view.centers.shape[1] == 3 and len(view.centers) > 50
    distance = np.linalg.norm(view.centers - np.array([0.0, 0.0, 0.3]), axis=1)
    assert distance.min() > 0.1, "the middle of a ball is hidden by what is around it"


def test_a_slice_is_bright_where_the_field_is_dense() -> None:
    view = sensing.slice_view(PLACE, SliceQuestion(0.3 / 0.8))
    rows, columns, channels = view.image.shape
    assert channels == 4
    middle, corner = view.image[rows // 2, columns // 2], view.image[0, 0]
    assert middle[3] > 200 and corner[3] < 80
    assert torch.tensor(middle[:3].astype(int)).sum() > torch.tensor(corner[:3].astype(int)).sum()


def test_space_that_no_camera_saw_is_shown_where_the_field_knows_of_any() -> None:
    asked = SpaceQuestion(Space.UNKNOWN)
    assert len(sensing.space_view(PLACE, asked).centers) == 0
    place, lower, upper = partly_seen()
    view = sensing.space_view(place, asked)
    assert len(view.centers) > 50
    assert (view.centers >= lower - 1e-5).all() and (view.centers <= upper + 1e-5).all()


def test_what_no_camera_saw_is_occupied_and_near_as_it_is_for_planners() -> None:
    place, lower, upper = partly_seen()
    middle = 0.5 * (lower + upper)
    occupied, as_seen = (sensing.space_view(one, SpaceQuestion(Space.OCCUPIED)) for one in (place, PLACE))
    near = [(np.abs(view.centers - middle) < 0.6 * (upper - lower)).all(1).sum() for view in (occupied, as_seen)]
    assert near[0] > 50 and near[1] == 0
    states = RigidState.stack([RigidState.at_rest(tuple(middle.tolist()))] * 2)
    still = ProfileQuestion(0, Motion(states, torch.zeros(1, 4), 0.1))
    (_, inside, _), (_, outside, _) = (sensing.profile(one, still).rows for one in (place, PLACE))
    assert inside[0] == 0 < outside[0]

"""What the worker tells the page about a place."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from app import sensing
from app.ends import End, Which
from app.look import Eye
from app.questions import EndQuestion, EyeQuestion, PointQuestion, SliceQuestion, Space, SpaceQuestion
from nerfnav.field.voxel import VoxelField
from nerfnav.planner.occupancy import OccupancyConfig, body_density
from tests.app.doubles import balls_place

PLACE = balls_place()


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
    field = PLACE.field
    assert isinstance(field, VoxelField)
    unseen = torch.zeros(field.shape, dtype=torch.bool)
    unseen[10:20, 10:20, 4:12] = True
    view = sensing.space_view(replace(PLACE, field=replace(field, unknown=unseen)), asked)
    lower = field.box.lower.numpy() + field.spacing.numpy() * [10, 10, 4]
    upper = field.box.lower.numpy() + field.spacing.numpy() * [19, 19, 11]
    assert len(view.centers) > 50
    assert (view.centers >= lower - 1e-5).all() and (view.centers <= upper + 1e-5).all()

"""Finding a camera from nothing."""

import pytest
import torch

from nerfnav.errors import InvalidInputError
from nerfnav.estimator.photometric import ColorNoise
from nerfnav.estimator.relocalise import Looks, RelocaliseConfig, RelocaliseOutcome, Searcher, distinct, free_places
from nerfnav.geometry.camera import FORWARD_MOUNT, Camera, Pose
from nerfnav.geometry.so3 import from_yaw
from nerfnav.robots.state import RigidState
from tests.estimator.places import BOX, CAMERA, COLOR_STD, balls, picture

CONFIG = RelocaliseConfig(spacing=0.4, headings=8, halvings=(1, 0), kept=(12, 3))


def test_a_camera_is_found_from_its_picture_alone():
    truth = RigidState.at_rest((-0.35, 0.05, 0.28), 0.1)
    *steps, last = Searcher(balls(), CAMERA, ColorNoise(std=COLOR_STD), CONFIG).relocalise(picture(balls(), truth))
    assert steps[0].fraction == 0 and last.fraction == 1
    assert last.outcome is RelocaliseOutcome.FOUND
    found = last.body_pose(FORWARD_MOUNT)
    assert (found.position - truth.position).norm() < 0.02
    assert float(last.weights.sum()) == pytest.approx(1)


def test_free_places_are_in_the_box_and_have_no_density_around():
    places = free_places(balls(), 0.2)
    assert BOX.contains(places).all()
    assert (balls().density(places) < 1).all()
    assert len(places) > 20


def test_poses_that_are_alike_count_once():
    yaw = torch.tensor([0.0, 0.05, 1.0])
    poses = Pose(from_yaw(yaw), torch.tensor([[0.0, 0.0, 0.0], [0.01, 0.0, 0.0], [0.0, 0.0, 0.0]]))
    assert distinct(poses, torch.tensor([2.0, 1.0, 3.0]), (0.1, 0.2)).tolist() == [1, 2]


def test_a_field_without_free_places_is_refused():
    with pytest.raises(InvalidInputError, match="no free place"):
        Looks.of(balls(), Camera.from_fov(8, 8, 90), torch.zeros(0, 3), CONFIG)

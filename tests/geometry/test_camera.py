"""Cameras: where pixels look."""

import math

import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import so3
from nerfnav.geometry.camera import FORWARD_MOUNT, Camera, Pose, look_at


def test_the_middle_of_the_image_looks_along_minus_z():
    camera = Camera.from_fov(5, 3, 90)
    torch.testing.assert_close(camera.directions(torch.tensor([2, 1])), torch.tensor([0.0, 0.0, -1.0]))


def test_the_image_spans_the_field_of_view():
    camera = Camera.from_fov(200, 100, 90)
    left, right = camera.directions(torch.tensor([[0, 50], [199, 50]]))
    half_pixel = math.atan(99.5 / 100)
    assert math.atan2(-left[0], -left[2]) == pytest.approx(half_pixel, abs=1e-6)
    assert math.atan2(right[0], -right[2]) == pytest.approx(half_pixel, abs=1e-6)


def test_pixels_run_row_by_row_to_the_right_and_down():
    camera = Camera.from_fov(3, 2, 60)
    assert camera.pixels().tolist() == [[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1]]
    directions = camera.directions(camera.pixels())
    assert directions[2, 0] > directions[0, 0]
    assert directions[3, 1] < directions[0, 1]


def test_rays_start_at_the_camera_and_turn_with_it():
    camera = Camera.from_fov(4, 6, 70)
    pose = Pose(so3.exp(torch.tensor([0.3, -0.2, 0.5])), torch.tensor([1.0, 2.0, 3.0]))
    origins, directions = camera.rays(pose)
    assert origins.shape == directions.shape == (24, 3)
    assert (origins == pose.position).all()
    torch.testing.assert_close(directions @ pose.rotation, camera.directions(camera.pixels()))
    some, _ = camera.rays(pose, torch.tensor([[1, 2]]))
    assert some.shape == (1, 3)


def test_gradients_flow_from_rays_to_the_pose():
    theta, place = torch.zeros(3, requires_grad=True), torch.zeros(3, requires_grad=True)
    origins, directions = Camera.from_fov(3, 3, 60).rays(Pose(so3.exp(theta), place))
    (origins.sum() + directions[:, 0].sum()).backward()
    assert place.grad is not None and (place.grad == 9).all()
    assert theta.grad is not None and theta.grad.abs().sum() > 0


@pytest.mark.parametrize("factor", [0.5, 2.0, 0.33])
def test_a_scaled_camera_sees_the_same(factor: float):
    camera = Camera.from_fov(200, 120, 80)
    scaled = camera.scaled(factor)
    assert (scaled.width, scaled.height) == (round(200 * factor), round(120 * factor))
    for one, other, size, scaled_size in (
        (camera.fx, scaled.fx, camera.width, scaled.width),
        (camera.fy, scaled.fy, camera.height, scaled.height),
        (camera.cx, scaled.cx, camera.width, scaled.width),
        (camera.cy, scaled.cy, camera.height, scaled.height),
    ):
        assert other / scaled_size == pytest.approx(one / size)


@pytest.mark.parametrize(("width", "height", "fov"), [(0, 5, 60), (5, -1, 60), (5, 5, 0), (5, 5, 180)])
def test_impossible_cameras_are_refused(width: int, height: int, fov: float):
    with pytest.raises(InvalidInputError, match="a camera needs"):
        Camera.from_fov(width, height, fov)


def test_looking_at_a_point_puts_it_in_the_middle_and_up_above():
    eye, target = torch.tensor([[1.0, 2.0, 0.5], [0.0, 0.0, 3.0]]), torch.tensor([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    pose = look_at(eye, target)
    forward = -pose.rotation[..., 2]
    torch.testing.assert_close(forward, torch.nn.functional.normalize(target - eye, dim=-1))
    torch.testing.assert_close(torch.det(pose.rotation), torch.ones(2))
    torch.testing.assert_close(pose.rotation @ pose.rotation.mT, torch.eye(3).expand(2, 3, 3), rtol=0, atol=1e-6)
    assert pose.rotation[0, 2, 1] > 0  # the image's top points upwards, also in a picture taken from above


def test_the_forward_mount_looks_where_the_body_heads():
    body = Pose(so3.from_yaw(torch.tensor(math.pi / 2)), torch.tensor([1.0, 0.0, 0.0]))
    camera = body.compose(FORWARD_MOUNT)
    torch.testing.assert_close(-camera.rotation[:, 2], torch.tensor([0.0, 1.0, 0.0]), rtol=0, atol=1e-6)
    torch.testing.assert_close(camera.rotation[:, 1], torch.tensor([0.0, 0.0, 1.0]), rtol=0, atol=1e-6)
    torch.testing.assert_close(camera.position, body.position)


def test_composing_poses_moves_points_through_both_frames():
    first = Pose(so3.exp(torch.tensor([0.1, 0.2, 0.3])), torch.tensor([1.0, 0.0, 2.0]))
    second = Pose(so3.exp(torch.tensor([-0.4, 0.2, 0.0])), torch.tensor([0.0, 3.0, 0.0]))
    point = torch.tensor([0.5, -0.5, 1.0])
    both = first.compose(second)
    stepwise = first.rotation @ (second.rotation @ point + second.position) + first.position
    torch.testing.assert_close(both.rotation @ point + both.position, stepwise)


def test_what_a_pixel_sees_is_projected_onto_it() -> None:
    camera = Camera(40, 30, fx=25.0, fy=28.0, cx=18.5, cy=14.0)
    pose = look_at(torch.tensor([1.0, -2.0, 0.7]), torch.tensor([0.2, 0.1, 0.3]))
    origins, directions = camera.rays(pose)
    depth = torch.rand(len(origins), 1, generator=torch.Generator().manual_seed(0)) + 0.1
    uv, inside = camera.project(pose, origins + depth * directions)
    torch.testing.assert_close(uv, camera.pixels() + 0.5, atol=1e-3, rtol=0)
    assert inside.all()


def test_what_is_behind_a_camera_or_beside_its_picture_is_not_in_it() -> None:
    camera = Camera.from_fov(40, 40, 90.0)
    pose = Pose(torch.eye(3), torch.zeros(3))  # looks along -z
    points = torch.tensor([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [1.01, 0.0, -1.0], [0.99, -0.99, -1.0]])
    uv, inside = camera.project(pose, points)
    assert inside.tolist() == [False, False, False, True]
    assert uv[:2].isnan().all()
    assert uv[3].tolist() == pytest.approx([39.8, 39.8])


@pytest.mark.parametrize(
    ("numbers", "said"),
    [
        ((48, 36, 40.0, 1e-171, 24.0, 18.0), "focal lengths are above 0 pixels"),
        ((48, 36, math.nan, 40.0, 24.0, 18.0), "focal lengths are above 0 pixels"),
        ((48, 36, 1e30, 40.0, 24.0, 18.0), "focal lengths are above 0 pixels"),
        ((48, 36, 40.0, 40.0, -1e30, 18.0), "the principal point is"),
        ((0, 36, 40.0, 40.0, 24.0, 18.0), "1 to 65536 pixels"),
        ((48, 70000, 40.0, 40.0, 24.0, 18.0), "1 to 65536 pixels"),
    ],
)
def test_numbers_whose_rays_would_overflow_are_refused(numbers: tuple[float, ...], said: str) -> None:
    with pytest.raises(InvalidInputError, match=said):
        Camera.of_numbers(numbers)

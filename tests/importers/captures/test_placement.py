"""Up direction and box of a field, from cameras alone."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from nerfnav.field.render.volume_rendering import render_image
from nerfnav.geometry import so3
from nerfnav.geometry.box import Box
from nerfnav.geometry.camera import Camera, Pose, look_at
from nerfnav.geometry.images import PosedImages
from nerfnav.importers.captures.placement import box_of_cameras, box_of_silhouettes, estimate_up, focus_of
from nerfnav.importers.core.placement import rotation_to_z
from tests.field.fields import ball
from tests.importers.captures.synthetic import matrices, ring


def held(poses: Pose, degrees: float, seed: int = 0) -> Pose:
    """The same cameras, each rolled about its axis by a random angle."""
    angles = math.radians(degrees) * torch.randn(len(poses.position), generator=torch.Generator().manual_seed(seed))
    zero = torch.zeros_like(angles)
    return Pose(poses.rotation @ so3.exp(torch.stack([zero, zero, angles], -1)), poses.position)


def tilted(poses: np.ndarray, up: np.ndarray) -> np.ndarray:
    """The same cameras in a world whose z axis lies along `up`."""
    turned = poses.copy()
    turned[:, :3, :] = rotation_to_z(up).T @ poses[:, :3, :]
    return turned


def test_level_cameras_tell_up_exactly_from_any_axes() -> None:
    for seed in range(5):
        up = np.random.default_rng(seed).normal(size=3)
        up /= np.linalg.norm(up)
        found, sure = estimate_up(tilted(matrices(ring(height=1.5)), up))
        np.testing.assert_allclose(found, up, atol=1e-5)
        assert sure


def test_hands_that_shake_by_five_degrees_tell_up_to_two() -> None:
    found, sure = estimate_up(tilted(matrices(held(ring(30), 5)), np.array([0.48, 0.6, 0.64])))
    assert math.degrees(math.acos(found @ [0.48, 0.6, 0.64])) < 2
    assert sure


def test_cameras_that_are_nearly_level_with_an_axis_are_level() -> None:
    found, _ = estimate_up(tilted(matrices(ring()), np.array([0.01, 1.0, 0.0])))
    assert found.tolist() == [0, 1, 0]


def test_cameras_that_look_the_same_way_tell_up_by_their_tops() -> None:
    eyes = torch.tensor([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [1.0, 0.0, 0.3]])
    found, sure = estimate_up(matrices(look_at(eyes, eyes + torch.tensor([0.0, 2.0, 0.0]))))
    np.testing.assert_allclose(found, [0, 0, 1], atol=1e-6)
    assert sure


def test_cameras_that_look_straight_down_tell_up_but_not_for_sure() -> None:
    yaw = torch.linspace(0, 6, 12)
    down = so3.from_yaw(yaw) @ torch.eye(3)
    found, sure = estimate_up(matrices(Pose(down, torch.randn(12, 3))))
    np.testing.assert_allclose(found, [0, 0, 1], atol=1e-6)
    assert not sure


def test_cameras_around_a_thing_have_it_in_their_focus_and_in_their_box() -> None:
    target = np.array([3.0, -1.0, 0.5])
    poses = matrices(ring(12))
    poses[:, :3, 3] += target
    focus = focus_of(poses)
    np.testing.assert_allclose(focus.point, target, atol=0.01)
    assert focus.depth == pytest.approx(2.05, abs=0.1)
    box = box_of_cameras(poses)
    assert box.contains(torch.from_numpy(poses[:, :3, 3]).float()).all()
    assert box.contains(torch.tensor(target).float() + 0.5 * torch.tensor([[0, 0, 1], [0, 0, -1], [1.0, 0, 0]])).all()
    assert float(box.size.max()) < 6


def test_cameras_that_look_outwards_get_a_box_beyond_themselves() -> None:
    poses = matrices(ring(12))
    poses[:, :3, [0, 2]] *= -1  # turned about
    box = box_of_cameras(poses)
    assert focus_of(poses).depth < 0
    assert box.lower[0] < -3 and box.upper[0] > 3 and box.size[2] > 0.3


def test_silhouettes_tell_the_box_of_what_is_shown() -> None:
    camera = Camera.from_fov(48, 48, 60)
    poses = ring(16, radius=1.6, height=1.2)
    opaque = torch.stack([render_image(ball(), camera, poses[index]).opacity > 0.3 for index in range(16)])
    photographs = PosedImages(torch.zeros(16, 48, 48, 3, dtype=torch.uint8), camera, poses, silhouettes=opaque)
    box = box_of_silhouettes(photographs, Box.of((-2, -2, -2), (2, 2, 2)))
    assert box is not None
    # the ball of radius 0.3 in the middle, with what the pictures' and nodes' coarseness adds
    assert bool((box.lower < -0.28).all()) and bool((box.upper > 0.28).all())
    assert float(box.size.max()) < 1.0
    nothing = replace(photographs, silhouettes=torch.zeros_like(opaque))
    assert box_of_silhouettes(nothing, Box.of((-2, -2, -2), (2, 2, 2))) is None

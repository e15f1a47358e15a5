"""Similarity transforms against what they are defined by."""

import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry.box import Box
from nerfnav.geometry.camera import Camera, look_at
from nerfnav.geometry.similarity import Similarity
from nerfnav.geometry.so3 import exp


def some(scale: float = 2.5) -> Similarity:
    rotation = exp(torch.tensor([0.4, -0.3, 0.9], dtype=torch.float64))
    return Similarity(rotation, torch.tensor([1.0, -2.0, 0.5], dtype=torch.float64), scale)


def test_what_is_taken_back_is_where_it_was() -> None:
    points = torch.randn(50, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    change = some()
    torch.testing.assert_close(change.inverted()(change(points)), points)
    assert torch.equal(Similarity.identity()(points), points) and not torch.allclose(change(points), points)


def test_distances_grow_by_the_scale() -> None:
    points = torch.randn(2, 3, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    moved = some(3.0)(points)
    torch.testing.assert_close((moved[0] - moved[1]).norm(), 3 * (points[0] - points[1]).norm())


def test_a_moved_camera_sees_moved_points_at_the_same_pixels() -> None:
    camera, pose = Camera.from_fov(64, 48, 80), look_at(torch.tensor([2.0, 1.0, 1.0]), torch.zeros(3))
    points, change = 0.3 * torch.randn(20, 3, generator=torch.Generator().manual_seed(2)), some()
    before, _ = camera.project(pose, points)
    after, _ = camera.project(change.pose(pose), change(points))
    torch.testing.assert_close(after, before, atol=1e-3, rtol=0)


def test_a_moved_box_holds_all_that_was_in_it() -> None:
    box, change = Box.of((-1, 0, 0), (1, 2, 0.5)), some()
    points = box.lower + torch.rand(500, 3, generator=torch.Generator().manual_seed(3)) * box.size
    moved = change.box(box)
    slack = 1e-5
    assert Box(moved.lower - slack, moved.upper + slack).contains(change(points)).all()


def test_quarter_turns_are_known_and_others_are_not() -> None:
    quarter = Similarity(exp(torch.tensor([torch.pi / 2, 0, 0], dtype=torch.float64)), torch.zeros(3).double())
    assert quarter.axes is not None and quarter.axes.tolist() == [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    assert some().axes is None


@pytest.mark.parametrize("scale", [0.0, -1.0, float("inf"), float("nan")])
def test_scales_that_no_place_can_have_are_refused(scale: float) -> None:
    with pytest.raises(InvalidInputError, match="scale of a similarity"):
        some(scale)


def test_mirrors_are_refused() -> None:
    with pytest.raises(InvalidInputError, match="rotation"):
        Similarity(torch.diag(torch.tensor([1.0, 1.0, -1.0])).double(), torch.zeros(3).double())


def test_numbers_make_the_same_again_and_one_goes_after_another() -> None:
    first, second = some(), some(2.5)
    again = Similarity.of_numbers(first.numbers)
    points = torch.rand(5, 3, dtype=torch.float64)
    torch.testing.assert_close(again(points), first(points))
    torch.testing.assert_close(second.after(first)(points), second(first(points)))

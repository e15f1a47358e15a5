"""Boxes."""

import torch

from nerfnav.geometry.box import Box

BOX = Box.of((-1, -2, 0), (1, 2, 0.5))


def test_a_box_holds_its_border_and_nothing_beyond():
    points = torch.tensor([[0, 0, 0.2], [1, 2, 0.5], [-1, -2, 0], [1.01, 0, 0.2], [0, 0, -0.01]])
    assert BOX.contains(points).tolist() == [True, True, True, False, False]


def test_a_point_that_is_not_a_number_is_not_inside():
    assert not BOX.contains(torch.tensor([0.0, float("nan"), 0.1]))


def test_size_and_center_follow_from_the_corners():
    assert BOX.size.tolist() == [2, 4, 0.5]
    assert BOX.center.tolist() == [0, 0, 0.25]


def test_a_box_is_told_in_metres():
    assert BOX.describe() == "x -1.00 to 1.00, y -2.00 to 2.00, z 0.00 to 0.50 m"

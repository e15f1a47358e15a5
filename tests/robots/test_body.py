"""What bodies are made of."""

import pytest
import torch

from nerfnav.robots.body import Body


def test_the_points_of_a_box_fill_it_up_to_its_faces():
    body = Body.box((0.1, 0.2, 0.04), (5, 3, 2))
    assert body.points_body.shape == (30, 3)
    half = torch.tensor([0.05, 0.1, 0.02])
    torch.testing.assert_close(body.points_body.amax(0), half)
    torch.testing.assert_close(body.points_body.amin(0), -half)
    assert len(body.points_body.unique(dim=0)) == 30


def test_a_single_point_along_an_edge_lies_in_its_middle():
    body = Body.box((0.1, 0.1, 0.04), (2, 2, 1))
    assert not body.points_body[:, 2].any()


def test_the_body_fits_into_the_ball_of_its_radius():
    body = Body.box((0.1, 0.2, 0.04), (2, 2, 2))
    assert body.points_body.norm(dim=-1).max().item() == pytest.approx(body.radius)


def test_a_grown_body_reaches_further_on_every_side():
    grown = Body.box((0.1, 0.2, 0.04), (5, 3, 2)).grown(0.01)
    assert grown.extents == pytest.approx((0.12, 0.22, 0.06))
    torch.testing.assert_close(grown.points_body.amax(0), torch.tensor([0.06, 0.11, 0.03]))
    assert len(grown.points_body) == 30

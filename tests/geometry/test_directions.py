"""Directions that are spread evenly."""

import torch

from nerfnav.geometry.camera import fibonacci_directions


def test_a_spiral_has_unit_vectors_of_the_heights_that_were_asked_for() -> None:
    heights = torch.linspace(-1, 1, 33)
    directions = fibonacci_directions(heights)
    torch.testing.assert_close(directions.norm(dim=-1), torch.ones(33))
    torch.testing.assert_close(directions[:, 2], heights)


def test_even_heights_spread_directions_evenly() -> None:
    count = 400
    directions = fibonacci_directions(1 - (torch.arange(count) + 0.5) * 2 / count)
    assert directions.mean(0).norm() < 1e-2
    torch.testing.assert_close(3 * directions.T @ directions / count, torch.eye(3), atol=1e-2, rtol=0)
    angle = torch.acos((directions @ directions.T - 2 * torch.eye(count)).amax(1).clamp(-1, 1))
    assert angle.min() > 0.7 * (4 * torch.pi / count) ** 0.5, "none is much nearer to another than the others are"

"""Planes through three points, and floors among many points."""

import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry.plane import fit_plane, plane_through


def _random(*shape: int) -> torch.Tensor:
    return torch.rand(*shape, generator=torch.Generator().manual_seed(7), dtype=torch.float64)


def test_a_plane_goes_through_its_points() -> None:
    points = torch.tensor([[0.0, 0.0, 1.0], [2.0, 0.0, 1.5], [0.0, 3.0, 0.5]])
    plane = plane_through(points)
    torch.testing.assert_close(plane.heights(points), torch.zeros(3, dtype=torch.float64), atol=1e-7, rtol=0)
    up = torch.tensor([0.0, 0.0, 1.0])
    assert plane.facing(up).normal[2] > 0 > plane.facing(-up).normal[2]


@pytest.mark.parametrize(
    "points",
    [[[0, 0, 0], [1, 1, 1], [2, 2, 2]], [[0, 0, 0], [0, 0, 0], [1, 0, 0]], [[0, 0, 0], [1, 0, 0], [2, 0.01, 0]]],
)
def test_three_points_on_a_line_make_no_floor(points: list[list[float]]) -> None:
    with pytest.raises(InvalidInputError, match="on one line"):
        plane_through(torch.tensor(points, dtype=torch.float32))


def test_a_tilted_floor_is_found_under_a_table_and_beside_a_wall() -> None:
    floor = torch.cat([4 * _random(1500, 2) - 2, torch.zeros(1500, 1).double()], 1)
    floor[:, 2] = 0.1 * floor[:, 0] + 0.3 + 0.004 * (_random(1500) - 0.5)
    table = torch.cat([_random(1200, 2), torch.full((1200, 1), 1.4).double()], 1)
    wall = torch.stack([torch.full((2500,), 2.0).double(), 4 * _random(2500, 2)[:, 0] - 2, 0.5 + 2 * _random(2500)], 1)
    points = torch.cat([floor, table, wall])
    found = fit_plane(points, torch.tensor([0.0, 0.0, 1.0]), torch.Generator().manual_seed(0))
    assert found is not None
    expected = torch.nn.functional.normalize(torch.tensor([-0.1, 0.0, 1.0], dtype=torch.float64), dim=0)
    assert torch.rad2deg(torch.acos((found.normal @ expected).clamp(-1, 1))) < 0.3
    assert abs(float(found.heights(torch.tensor([0.0, 0.0, 0.3])))) < 0.003


def test_no_floor_is_found_where_nothing_is_level() -> None:
    up, generator = torch.tensor([0.0, 0.0, 1.0]), torch.Generator().manual_seed(0)
    assert fit_plane(_random(3000, 3), up, generator) is None
    assert fit_plane(torch.zeros(2, 3), up, generator) is None

"""Grids of nodes and what lies between them."""

import torch

from nerfnav.geometry.box import Box
from nerfnav.geometry.grid import dilate_nodes, node_positions, shape_for, spacing_of, trilinear

BOX = Box.of((-1, 0, 2), (1, 3, 2.5))


def test_the_number_of_nodes_follows_from_their_distance():
    assert shape_for(BOX, 0.5) == (5, 7, 2)
    assert shape_for(BOX, 100) == (2, 2, 2)
    torch.testing.assert_close(spacing_of(BOX, (5, 7, 2)), torch.tensor([0.5, 0.5, 0.5]))


def test_nodes_stand_on_the_borders():
    nodes = node_positions(BOX, (5, 7, 3))
    assert nodes.shape == (5, 7, 3, 3)
    torch.testing.assert_close(nodes[0, 0, 0], BOX.lower)
    torch.testing.assert_close(nodes[-1, -1, -1], BOX.upper)


def test_interpolation_gives_back_the_nodes_and_is_exact_for_products_of_coordinates():
    nodes = node_positions(BOX, (5, 4, 3)).double()
    x, y, z = nodes.unbind(-1)
    values = torch.stack([1 + 2 * x - y, x * y * z], -1)
    torch.testing.assert_close(trilinear(values, BOX, nodes), values, rtol=0, atol=1e-6)
    points = BOX.lower + BOX.size * torch.rand(50, 3, generator=torch.Generator().manual_seed(0))
    found = trilinear(values, BOX, points.double())
    a, b, _ = points.double().unbind(-1)
    torch.testing.assert_close(found[:, 0], 1 + 2 * a - b, rtol=0, atol=1e-6)


def test_outside_the_border_has_its_say():
    values = torch.rand(3, 3, 3, 1, generator=torch.Generator().manual_seed(0))
    beyond = trilinear(values, BOX, BOX.upper + torch.tensor([1.0, 2.0, 3.0]))
    torch.testing.assert_close(beyond, values[-1, -1, -1])


def test_interpolation_has_right_first_and_second_derivatives():
    values = torch.rand(4, 4, 4, 2, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    generator = torch.Generator().manual_seed(1)
    points = (BOX.lower + BOX.size * torch.rand(6, 3, generator=generator)).double().requires_grad_()
    box = BOX.to(torch.float64)
    assert torch.autograd.gradcheck(lambda p: trilinear(values, box, p), (points,))
    assert torch.autograd.gradgradcheck(lambda p: trilinear(values, box, p), (points,))


def test_neighbours_along_axes_and_diagonals_are_chosen_too():
    chosen = torch.zeros(5, 6, 7, dtype=torch.bool)
    chosen[0, 3, 3] = True
    found = dilate_nodes(chosen)
    assert found[:2, 2:5, 2:5].all()
    assert found.sum() == 2 * 3 * 3

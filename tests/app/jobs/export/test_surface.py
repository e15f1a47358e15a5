"""The surface of a mesh that viewers get at once."""

import numpy as np
import pytest

from nerfnav.world import Paint
from nerfnav_app.jobs.export.surface import divide_triangles, nearest_colors


@pytest.mark.parametrize("edge", [10.0, 0.7, 0.11])
def test_divided_triangles_cover_the_same_and_have_no_edge_longer_than_asked(edge: float) -> None:
    triangles = np.random.default_rng(0).normal(size=(9, 3, 3))
    origin, weights, faces = divide_triangles(triangles, edge)
    assert np.allclose(weights.sum(1), 1) and weights.min() >= 0
    corners = np.einsum("nk,nki->ni", weights, triangles[origin])[faces]
    assert (origin[faces] == origin[faces][:, :1]).all()
    assert np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1).max() <= edge * 1.0001 or edge == 10.0
    normals, whole = (
        np.cross(part[:, 1] - part[:, 0], part[:, 2] - part[:, 0]) for part in (corners, triangles)
    )
    summed = np.zeros_like(whole)
    np.add.at(summed, origin[faces[:, 0]], normals)  # with their sides: none is turned around
    assert np.allclose(summed, whole, atol=1e-4)


def test_triangles_that_are_small_enough_stay_as_they_are() -> None:
    triangles = np.random.default_rng(0).normal(size=(9, 3, 3))
    origin, weights, faces = divide_triangles(triangles, np.inf)
    corners = np.einsum("nk,nki->ni", weights, triangles[origin])[faces]
    assert np.allclose(corners, triangles)


def test_points_have_the_nearest_pixel_of_their_texture_times_its_tint_or_the_tint_alone() -> None:
    image = np.zeros((4, 8, 3), np.uint8)
    image[:, :4, 0], image[:2, 4:, 2], image[2:, 4:, 1] = 255, 255, 255  # left red; right blue above, green below
    uv = np.array([[[0.1, 0.4], [2.6, 0.875], [-0.2, 0.125]], np.zeros((3, 2))], np.float32)
    tint = np.array([[[255, 255, 255]] * 2 + [[51, 51, 51]], [[0, 0, 0], [0, 100, 0], [0, 200, 0]]], np.uint8)
    paint = Paint((image,), np.array([0, -1], np.int32), uv, tint)
    face = np.array([0, 0, 0, 1], np.int32)
    weights = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0.5, 0.5]], np.float32)
    colors = nearest_colors(paint, face, weights)
    assert np.allclose(colors, [[255, 0, 0], [0, 0, 255], [0, 51, 0], [0, 150, 0]], atol=1e-3)
    assert np.allclose(colors, paint.color(face, weights), atol=1e-3), "a renderer shows something else"

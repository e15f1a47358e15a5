"""The surface of a mesh that viewers get at once."""

import numpy as np
import pytest

from nerfnav_app.jobs.export.surface import divide_triangles


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

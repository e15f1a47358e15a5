"""Texture atlas: each texel of a triangle shows that triangle, whatever lies below or above it."""

from collections.abc import Callable

import numpy as np

from nerfnav.field.surface.atlas import atlas_of


def floor_with_a_slide() -> tuple[np.ndarray, np.ndarray]:
    """A floor, and a slide above it that ends in it: one sheet of triangles that face up, with two layers."""
    vertices: list[tuple[float, float, float]] = []
    faces = []

    def sheet(nx: int, ny: int, place: Callable[[float, float], tuple[float, float, float]]) -> None:
        first = len(vertices)
        vertices.extend(place(i / nx, j / ny) for i in range(nx + 1) for j in range(ny + 1))
        for i in range(nx):
            for j in range(ny):
                a = first + i * (ny + 1) + j
                faces.extend([(a, a + ny + 1, a + 1), (a + 1, a + ny + 1, a + ny + 2)])

    sheet(16, 24, lambda u, v: (2 * u, 3 * v, 0.0))
    sheet(11, 8, lambda u, v: (2 * u, 1 + v, 0.8 * (1 - u)))
    points, number = np.unique(np.round(vertices, 6), axis=0, return_inverse=True)
    return points, number.reshape(-1)[np.array(faces)]


def test_texels_of_two_layers_of_one_chart_show_their_own_layer() -> None:
    vertices, faces = floor_with_a_slide()
    texel = 0.02
    atlas = atlas_of(vertices, faces, texel, 1 << 20)
    for weights in np.random.default_rng(0).dirichlet((1, 1, 1), 40):
        column, row = np.round(np.einsum("k,mki->mi", weights, atlas.texels[atlas.faces])).astype(int).T
        shown = atlas.shown(vertices, row * atlas.size[1] + column)
        wanted = np.einsum("k,mki->mi", weights, vertices[faces])
        assert np.linalg.norm(shown - wanted, axis=1).max() < 3 * texel

"""Meshes as solids for booleans."""

import numpy as np
from jaxtyping import Float, Int
from manifold3d import Error, Manifold, Mesh64


def manifold_of(vertices: Float[np.ndarray, "v 3"], faces: Int[np.ndarray, "f 3"]) -> Manifold | None:
    """The solid that triangles bound, seen counter-clockwise from outside; None where they bound no volume."""
    corners = np.ascontiguousarray(faces, np.uint64)
    manifold = Manifold(Mesh64(np.ascontiguousarray(vertices, np.float64), corners))
    return manifold if manifold.status() == Error.NoError and manifold.volume() > 0 else None

"""Triangulation of polygons: fans where they are convex, ear clipping where they are not."""

import manifold3d
import numpy as np
from jaxtyping import Float, Int

from nerfnav.importers.meshes.parts import LARGEST

_FLAT = 1e-9
"""Turns below this share of a polygon's area, at its corners, are straight on."""


def triangulate(
    vertices: Float[np.ndarray, "v 3"], corners: Int[np.ndarray, " c"], counts: Int[np.ndarray, " p"]
) -> Int[np.ndarray, "f 3"]:
    """Divide polygons into triangles, as positions in `corners`.

    Polygon i has the next counts[i] of the `corners`, each the index of a vertex. Those of less than three corners are
    left out. The triangles keep the order of the polygons and the way they face.
    """
    # those that are no finite numbers are refused once their faces are known
    vertices = np.where(np.abs(vertices) < LARGEST, vertices, 0.0)
    first = np.cumsum(counts) - counts
    found, order = [np.zeros((0, 3), np.int64)], [np.zeros(0, np.int64)]
    for count in np.unique(counts[counts >= 3]):
        chosen = np.flatnonzero(counts == count)
        positions = first[chosen, None] + np.arange(count)
        if count == 3:
            found.append(positions)
            order.append(chosen)
            continue
        points = vertices[corners[positions]]
        normals = _normals(points)
        turns = np.cross(points - np.roll(points, 1, 1), np.roll(points, -1, 1) - points)
        bends = (turns * normals[:, None]).sum(-1)
        is_concave = (bends < -_FLAT * (normals * normals).sum(-1, keepdims=True)).any(1)
        fan = np.stack([np.zeros(count - 2, int), np.arange(1, count - 1), np.arange(2, count)], 1)
        found.append(positions[~is_concave][:, fan].reshape(-1, 3))
        order.append(np.repeat(chosen[~is_concave], count - 2))
        for index in np.flatnonzero(is_concave):
            found.append(positions[index][_clip(points[index], normals[index])])
            order.append(np.full(len(found[-1]), chosen[index]))
    return np.concatenate(found)[np.argsort(np.concatenate(order), kind="stable")]


def _normals(points: Float[np.ndarray, "n k 3"]) -> Float[np.ndarray, "n 3"]:
    """Normals of polygons, as long as twice their area (Newell)."""
    around = points - points[:, :1]
    return np.cross(around, np.roll(around, -1, 1)).sum(1)


def _clip(points: Float[np.ndarray, "k 3"], normal: Float[np.ndarray, " 3"]) -> Int[np.ndarray, "t 3"]:
    """Triangles of one polygon, by ear clipping in its plane."""
    normal = normal / np.linalg.norm(normal)
    x = np.cross(np.eye(3)[np.abs(normal).argmin()], normal)
    x /= np.linalg.norm(x)
    return manifold3d.triangulate([(points - points[0]) @ np.stack([x, np.cross(normal, x)], 1)])

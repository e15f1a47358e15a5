"""Sparse model for viewers: the cameras and points of photographs, before there is a field."""

import numpy as np
import trimesh

from nerfnav.geometry import Box
from nerfnav.importers.captures.placement import estimate_up
from nerfnav.importers.core.placement import rotation_to_z
from nerfnav.importers.core.progress import SparseModel
from nerfnav_app.places.surface_glb import encode_colored_glb

_MOST_POINTS = 4000
_EDGE = 10.0
"""Longest edge of what is shown while cameras are being posed [m]: a model grows and its unit changes, but the view of
it stays."""
_POINT, _CAMERA = 0.002, 0.02
"""Radius of a point and length of a camera, in longest edges of the box."""
_ASTRAY = 0.02
"""Share of the points on each side of each axis that is not shown: some points are wrong, and far away."""
_POINT_COLOR, _CAMERA_COLOR = (120, 150, 180), (235, 120, 30)

_TETRAHEDRON = trimesh.Trimesh(
    [(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)], [(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)], process=False
)
_PYRAMID = trimesh.Trimesh(
    [(0, 0, 0), (-0.6, -0.45, -1), (0.6, -0.45, -1), (0.6, 0.45, -1), (-0.6, 0.45, -1)],
    [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 1), (1, 3, 2), (1, 4, 3)],
    process=False,
)
"""A camera that looks along -z."""


def encode_sparse_model(model: SparseModel) -> bytes:
    """Cameras as pyramids and the points in its box as tetrahedra, as unlit binary glTF.

    A model without a box has two cameras or more, apart from each other; it is turned until z is up, as far as the
    cameras tell, and scaled.
    """
    boxed = _boxed(model) if model.box is None else model
    assert boxed.box is not None
    box = (boxed.box.lower.tolist(), boxed.box.upper.tolist())
    inside = ((boxed.points >= box[0]) & (boxed.points <= box[1])).all(1)
    points = boxed.points[inside]
    points = points[:: -(-len(points) // _MOST_POINTS) or 1]
    edge = float(boxed.box.size.max())
    specks = _copies(_TETRAHEDRON, _POINT * edge, points, np.eye(3)[None], _POINT_COLOR)
    cameras = _copies(_PYRAMID, _CAMERA * edge, boxed.poses[:, :3, 3], boxed.poses[:, :3, :3], _CAMERA_COLOR)
    return encode_colored_glb(specks + cameras, box)


def _boxed(model: SparseModel) -> SparseModel:
    """The model upright in a box of `_EDGE`, in which it fits but for its outermost points."""
    turn = rotation_to_z(estimate_up(model.poses)[0])
    centers, points = model.poses[:, :3, 3] @ turn.T, model.points @ turn.T
    if len(points):
        lower, upper = np.quantile(points, (_ASTRAY, 1 - _ASTRAY), axis=0)
        points = points[((points >= lower) & (points <= upper)).all(1)]
    shown = np.concatenate([centers, points])
    middle, scale = (shown.min(0) + shown.max(0)) / 2, _EDGE / np.ptp(shown, axis=0).max()
    poses = model.poses.copy()
    poses[:, :3, :3], poses[:, :3, 3] = turn @ model.poses[:, :3, :3], scale * (centers - middle)
    return SparseModel(poses, scale * (points - middle), Box.of(*(np.full(3, sign * _EDGE / 2) for sign in (-1, 1))))


def _copies(
    shape: trimesh.Trimesh, size: float, places: np.ndarray, turns: np.ndarray, color: tuple[int, int, int]
) -> trimesh.Trimesh:
    """One mesh of copies of a shape at places (n, 3), turned (n or 1, 3, 3), of a size and a colour."""
    corners = places[:, None] + size * shape.vertices @ np.swapaxes(turns, 1, 2)
    faces = shape.faces + len(shape.vertices) * np.arange(len(places))[:, None, None]
    colors = np.full((corners.shape[0] * corners.shape[1], 3), color, np.uint8)
    return trimesh.Trimesh(corners.reshape(-1, 3), faces.reshape(-1, 3), vertex_colors=colors, process=False)

"""Shapes of robots, and 95 % regions of beliefs.

Bodies of robots and balls are triangles. The region of a position is an ellipsoid, that of an attitude a cone of
segments around the nose.
"""

from dataclasses import dataclass

import numpy as np
import torch
import viser.transforms as tf

from nerfnav.estimator import Belief
from nerfnav.geometry import ellipsoid_95
from nerfnav.robots import ATTITUDE, POSITION, Body

_AROUND = 16  # corners of a circle


@dataclass(frozen=True)
class Shape:
    """Triangles, seen counter-clockwise from outside."""

    vertices: np.ndarray
    """(v, 3) [m]."""
    faces: np.ndarray
    """Vertices of each triangle (f, 3)."""

    def joined(self, other: "Shape") -> "Shape":
        """Join both shapes into one."""
        vertices = np.concatenate([self.vertices, other.vertices])
        return Shape(vertices, np.concatenate([self.faces, other.faces + np.uint32(len(self.vertices))]))


def robot_shape(extents: tuple[float, float, float]) -> Shape:
    """Build a box of these edge lengths [m] with a nose that points forward."""
    return _box(extents).joined(_nose(extents))


def _nose(extents: tuple[float, float, float]) -> Shape:
    length, width, height = extents
    base, tip = 0.5 * length, 0.85 * length
    nose = _turned(np.array([[base, 0.5 * height], [tip, 0]]))
    return Shape(nose.vertices * np.array([1, 0.7 * width / height, 1], np.float32), nose.faces)


def body_shape(body: Body) -> Shape:
    """Build a robot's own body, a box or its solid, with a nose that points forward."""
    if body.solid is None:
        return robot_shape(body.extents)
    corners, faces = np.asarray(body.solid.vertices, np.float32), np.asarray(body.solid.faces, np.uint32)
    return Shape(corners, faces).joined(_nose(body.extents))


def ball() -> Shape:
    """Build a ball of radius 1 m."""
    angle = np.linspace(np.pi, 0, _AROUND // 2 + 1)
    return _turned(np.stack([np.cos(angle), np.sin(angle)], -1))


def _box(extents: tuple[float, float, float]) -> Shape:
    """A box around the origin."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    return Shape((corners * extents).astype(np.float32), quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3).astype(np.uint32))


def _turned(profile: np.ndarray) -> Shape:
    """Revolve a profile (p, 2) of points (x, radius) about the x axis."""
    angle = np.arange(_AROUND) * (2 * np.pi / _AROUND)
    circle = np.stack([np.ones(_AROUND), np.cos(angle), np.sin(angle)], -1)
    rings = profile[:, [0, 1, 1]][:, None] * circle
    here = np.stack([np.arange(_AROUND), np.roll(np.arange(_AROUND), -1)], -1)
    lower = here + _AROUND * np.arange(len(profile) - 1)[:, None, None]
    quads = np.concatenate([lower, lower[..., ::-1] + _AROUND], -1).reshape(-1, 4)
    # a ring of radius 0 is one point, and of each quad at it a triangle is left
    vertices, index = np.unique(np.round(rings.reshape(-1, 3), 9), axis=0, return_inverse=True)
    faces = index.reshape(-1)[quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)]
    whole = (np.diff(np.sort(faces)) > 0).all(-1)
    return Shape(vertices.astype(np.float32), faces[whole].astype(np.uint32))


def tube(centers: np.ndarray, radius: float, deviations: np.ndarray) -> Shape:
    """Build a tube with round ends around a line.

    Args:
        centers: Points of the line (n, 3) [m].
        radius: Radius of the body [m].
        deviations: Standard deviations at each point, level and vertical (n, 2) [m]: two are added to the radius.
    """
    ahead = _tangents(centers)
    angle = np.linspace(0, np.pi / 2, _CAP + 1)[1:]
    # rings beyond both ends: moved along the tangent, and narrower
    moved = np.concatenate([-np.sin(angle[::-1]), np.zeros(len(centers)), np.sin(angle)])
    width = np.concatenate([np.cos(angle[::-1]), np.ones(len(centers)), np.cos(angle)])
    at = np.clip(np.arange(-_CAP, len(centers) + _CAP), 0, len(centers) - 1)
    around = np.arange(_AROUND) * (2 * np.pi / _AROUND)
    circle = np.stack([np.cos(around), np.sin(around)], -1) @ np.stack(_across(ahead), 1)
    outward = moved[:, None, None] * ahead[at][:, None] + width[:, None, None] * circle[at]
    level, height = (deviations[at, axis, None] for axis in range(2))
    rise = outward[..., 2] ** 2
    reach = radius + _SIGMAS * np.sqrt(level**2 * (1 - rise).clip(0) + height**2 * rise)
    vertices = (centers[at][:, None] + reach[..., None] * outward).reshape(-1, 3)
    here = np.stack([np.arange(_AROUND), np.roll(np.arange(_AROUND), -1)], -1)
    lower = here + _AROUND * np.arange(len(at) - 1)[:, None, None]
    quads = np.concatenate([lower, lower[..., ::-1] + _AROUND], -1).reshape(-1, 4)
    return Shape(vertices.astype(np.float32), quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3).astype(np.uint32))


_CAP, _SIGMAS = 3, 2.0
"""Rings of a round end; standard deviations of room for noise."""


def _tangents(centers: np.ndarray) -> np.ndarray:
    """Compute unit tangents (n, 3) of a line; where it rests, that before, or a level one."""
    ahead = np.gradient(centers.astype(np.float64), axis=0)
    last = np.array([1.0, 0.0, 0.0])
    moving = np.linalg.norm(ahead, axis=-1)
    if (moving > _RESTS).any():
        last = ahead[moving > _RESTS][0] / moving[moving > _RESTS][0]
    for index, length in enumerate(moving):
        last = ahead[index] / length if length > _RESTS else last
        ahead[index] = last
    return ahead


def _across(ahead: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Carry two unit vectors across the tangents (n, 3) along the line, without a twist."""
    first = np.zeros_like(ahead)
    axis = np.eye(3)[np.abs(ahead[0]).argmin()]
    for index, tangent in enumerate(ahead):
        axis = axis - (axis @ tangent) * tangent
        first[index] = axis = axis / max(float(np.linalg.norm(axis)), _RESTS)
    return first, np.cross(ahead, first)


_RESTS = 1e-6
"""Length below which a vector has no direction."""
_NOSE, _RIM = 0.2, 12  # length [m] and number of the lines that show where the nose may point
_LEAST_AXIS = 1e-4  # [m]: a flat ellipsoid has no rotation


def ellipsoids(beliefs: list[Belief]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Compute centres (n, 3) [m], attitudes (n, 4) and half axes (n, 3) [m] of the 95 % ellipsoids of the positions."""
    if not beliefs:
        return np.zeros((0, 3)), np.zeros((0, 4)), np.zeros((0, 3))
    centers = np.stack([belief.mean.position.detach().numpy() for belief in beliefs])
    axes, half = ellipsoid_95(torch.stack([belief.covariance[POSITION, POSITION] for belief in beliefs]))
    return centers, tf.SO3.from_matrix(axes.numpy()).wxyz, np.maximum(half.numpy(), _LEAST_AXIS)


def cone(belief: Belief, scale: float = 1.0) -> np.ndarray:
    """Build segments (n, 2, 3) [m] from the mean position along the headings on the rim of the 95 % region."""
    axes, lengths = ellipsoid_95(belief.covariance[ATTITUDE, ATTITUDE])
    half = scale * (axes * lengths).numpy()
    angles = np.linspace(0, 2 * np.pi, _RIM, endpoint=False)
    circle = np.stack([np.cos(angles), np.sin(angles)], -1)
    rim = np.concatenate([circle @ half[:, pair].T for pair in ([0, 1], [1, 2], [0, 2])])
    turned = belief.mean.rotation.double().numpy() @ tf.SO3.exp(rim).as_matrix()
    start = belief.mean.position.detach().double().numpy()
    return np.stack([np.broadcast_to(start, (len(turned), 3)), start + _NOSE * turned[:, :, 0]], 1)

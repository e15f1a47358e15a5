"""Model of structure from motion: lens, poses and points, and where frames show these."""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int

_BEHIND = 1e-9
"""Depth below which a point counts as behind the camera, in the model's units."""


@dataclass(frozen=True)
class SharedLens:
    """Lens of all frames: one focal length, radial distortion; the principal point is the middle of the picture."""

    focal: float
    """Focal length [pixels]."""
    center: tuple[float, float]
    """Principal point [pixels]; pixel corners are at whole numbers."""
    k1: float = 0.0
    """First coefficient of radial distortion."""
    k2: float = 0.0
    """Second one."""

    def rays(self, pixels: Float[np.ndarray, "k 2"]) -> Float[np.ndarray, "k 2"]:
        """Return x / z and y / z of the rays through pixels, in the camera's OpenCV axes."""
        if not len(pixels):  # of which OpenCV makes an error
            return pixels.copy()
        (cx, cy), f = self.center, self.focal
        matrix = np.array([[f, 0, cx], [0, f, cy], [0, 0, 1.0]])
        return cv2.undistortPoints(pixels, matrix, np.array([self.k1, self.k2, 0, 0]))[:, 0]


@dataclass(frozen=True)
class Model:
    """Lens, poses and points, in a world and units of their own."""

    rotations: Float[np.ndarray, "n 3 3"]
    """R_camera_world of each frame, with OpenCV axes."""
    translations: Float[np.ndarray, "n 3"]
    """t_camera_world of each frame."""
    points: Float[np.ndarray, "m 3"]
    """Points, in the world."""
    lens: SharedLens
    """Lens of all frames."""

    @property
    def centers(self) -> Float[np.ndarray, "n 3"]:
        """Positions of the cameras, in the world."""
        return -np.einsum("nji,nj->ni", self.rotations, self.translations)

    def project(
        self, frame: Int[np.ndarray, " o"], point: Int[np.ndarray, " o"]
    ) -> tuple[Float[np.ndarray, "o 2"], Float[np.ndarray, " o"]]:
        """Project points into frames [pixels]; return also their depths, which are negative behind the camera."""
        at = np.einsum("oij,oj->oi", self.rotations[frame], self.points[point]) + self.translations[frame]
        uv = at[:, :2] / np.where(np.abs(at[:, 2]) < _BEHIND, _BEHIND, at[:, 2])[:, None]
        square = (uv**2).sum(1)
        factor = self.lens.focal * (1 + self.lens.k1 * square + self.lens.k2 * square**2)
        return uv * factor[:, None] + self.lens.center, at[:, 2]


@dataclass(frozen=True)
class Observations:
    """Places at which frames show points, sorted by point."""

    frame: Int[np.ndarray, " o"]
    """Frame of each."""
    point: Int[np.ndarray, " o"]
    """Point of each."""
    pixels: Float[np.ndarray, "o 2"]
    """Place of each [pixels]; pixel corners are at whole numbers."""

    def only(self, which: Bool[np.ndarray, " o"]) -> "Observations":
        """Return some of them."""
        return Observations(self.frame[which], self.point[which], self.pixels[which])


def sum_matrices(
    values: Float[np.ndarray, "o r c"], index: Int[np.ndarray, " o"], count: int
) -> Float[np.ndarray, "k r c"]:
    """Sum matrices by an index from 0 to before `count`."""
    rows, columns = values.shape[1:]
    flat = values.reshape(len(values), rows * columns).T
    return np.stack([np.bincount(index, each, minlength=count) for each in flat], 1).reshape(count, rows, columns)

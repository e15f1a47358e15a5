"""Views of a capture: pose, lens and depth map of each photograph, as its files give them.

All readers of captures share these records, and the checks of poses and JSON objects.
"""

import math
import os
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import numpy as np

from nerfnav.core.errors import InvalidInputError
from nerfnav.formats import LARGEST, KeyReport, parse_json, read_record, read_text
from nerfnav.geometry import Camera
from nerfnav.geometry.camera import require_lens

R = TypeVar("R", bound=msgspec.Struct)
_SKEWED = 1e-2
"""Largest deviation from a rotation of a matrix that was only rounded."""
ASPECT = 0.02
"""Largest relative difference of the aspect ratios of a picture and its calibration, or its depth map."""


class CaptureError(InvalidInputError):
    """A capture that no field can be trained from."""


@dataclass(frozen=True)
class Lens:
    """Intrinsics as shares of the picture's width and height, so that pictures that were stored smaller fit too."""

    focal_u: float
    """Focal length along u."""
    focal_v: float | None
    """Focal length along v; None: the pixels are square."""
    center: tuple[float, float] = (0.5, 0.5)
    """Principal point along u and v."""
    distortion: tuple[float, ...] = ()
    """OpenCV's k1, k2, p1, p2, k3, k4, k5, k6; none: a pinhole. Of a fisheye, k1, k2, k3, k4."""
    aspect: float | None = None
    """Width over height of the pictures that it was measured with, where that is known."""
    fisheye: bool = False
    """Fisheye model, see geometry/lens.py."""

    @classmethod
    def measured(
        cls,
        where: str,
        size: tuple[float, float],
        focal: tuple[float, float],
        center: tuple[float, float],
        *distortion: float,
        fisheye: bool = False,
    ) -> "Lens":
        """From numbers in pixels; `where` names their file. Raises CaptureError where they are those of no lens."""
        width, height = size
        numbers = (*size, *focal, *center, *distortion)
        if not all(abs(number) < LARGEST for number in numbers) or min(size) < 1:
            shown = ", ".join(f"{number:g}" for number in numbers)
            raise CaptureError(f"{where}: a lens needs finite numbers and a size of at least one pixel, not {shown}")
        padded = (distortion + 8 * (0.0,))[: 4 if fisheye else 8]
        coefficients = padded if fisheye or any(distortion) else ()
        focal_u, focal_v, shares = focal[0] / width, focal[1] / height, (center[0] / width, center[1] / height)
        try:
            require_lens((focal_u, focal_v), shares)
        except InvalidInputError as error:
            raise CaptureError(f"{where}: {error}") from error
        return cls(focal_u, focal_v, shares, coefficients, width / height, fisheye)

    def camera(self, width: int, height: int) -> Camera:
        """The camera of a picture of that size [pixels]; a distortion is left out, but for a fisheye's.

        Raises CaptureError where the picture has another shape than those that the lens was measured with.
        """
        if self.aspect is not None and abs(width / height / self.aspect - 1) > ASPECT + 1 / min(width, height):
            raise CaptureError(
                f"a picture of {width} x {height} pixels has another shape than its lens was measured with "
                f"(width over height {self.aspect:.3g}): was it cropped or turned?"
            )
        fx = self.focal_u * width
        fy = fx if self.focal_v is None else self.focal_v * height
        cx, cy = self.center[0] * width, self.center[1] * height
        return Camera(width, height, fx, fy, cx, cy, self.distortion if self.fisheye else (), self.fisheye)


@dataclass(frozen=True)
class DepthFile:
    """The depth map of one photograph, not read yet: distances along the optical axis, 0 where nothing was measured."""

    path: Path
    """File of the map."""
    unit: float = 0.001
    """Length of a stored 1, in the capture's units."""
    confidence: Path | None = None
    """A map of as many pixels that is 0 where the depth is unsure and to be left out; None: all are to be trusted."""
    farthest: float = math.inf
    """Depth beyond which the sensor only guesses, in the capture's units."""
    size: tuple[int, int] | None = None
    """Width and height [pixels], for files without a header."""

    @property
    def files(self) -> tuple[Path, ...]:
        """All that is read."""
        return (self.path,) if self.confidence is None else (self.path, self.confidence)


@dataclass(frozen=True)
class MaskFile:
    """Mask of one photograph, not read yet."""

    path: Path
    """Picture of as many pixels, or of the same shape."""
    inverted: bool = False
    """Pixels that are not 0 are left out (instant-ngp's dynamic masks), and not those that are 0."""


@dataclass(frozen=True, eq=False)
class View:
    """One photograph, not read yet."""

    name: str
    """Name in the capture."""
    path: Path
    """Expected file, which may be missing."""
    lens: Lens
    """Intrinsics of the photograph."""
    pose: np.ndarray
    """T_world_camera (4, 4), OpenGL axes, in the capture's own world and units."""
    test: bool = False
    """Member of the capture's test split."""
    depth: DepthFile | None = None
    """Its depth map; None where it has none."""
    mask: MaskFile | None = None
    """Mask of the pixels that count; None: all."""

    @property
    def files(self) -> tuple[Path, ...]:
        """All that may be read of it."""
        depth = () if self.depth is None else self.depth.files
        return (self.path, *depth, *(() if self.mask is None else (self.mask.path,)))

    @property
    def exists(self) -> bool:
        """True where the file exists; false for names that the file system refuses."""
        return os.path.isfile(self.path)

    def judging(self) -> "View":
        """The same view as a member of the test split."""
        return replace(self, test=True)

    def transformed(self, similarity: np.ndarray) -> "View":
        """The same view in a world that a 4 x 4 similarity maps this one into; the pose stays rigid."""
        pose = similarity @ self.pose
        pose[:3, :3] /= np.cbrt(np.linalg.det(similarity[:3, :3]))
        return replace(self, pose=pose)


@dataclass(frozen=True, eq=False)
class Tracks:
    """Points that structure from motion found, and which photographs show each of them."""

    points: np.ndarray
    """Positions (m, 3), in the capture's own world and units."""
    names: tuple[str, ...]
    """Of each sighting (k), what the capture calls the photograph."""
    numbers: np.ndarray
    """Of each sighting (k), which of the points it shows."""

    def transformed(self, similarity: np.ndarray) -> "Tracks":
        """The same points in a world that a 4 x 4 similarity maps this one into."""
        return replace(self, points=self.points @ similarity[:3, :3].T + similarity[:3, 3])


@dataclass(frozen=True)
class Views:
    """Views of a capture with their tracks."""

    kind: str
    """Kind of capture: "transforms.json", "Blender", "COLMAP"."""
    views: tuple[View, ...]
    """Every photograph that is named, whether it exists or not."""
    tracks: Tracks | None = None
    """Points that were found in them; None where the capture brings none."""
    keys: KeyReport = field(default_factory=KeyReport)
    """Keys of its files, by their treatment."""
    guesses: tuple[str, ...] = ()
    """Choices between files that hold different things, one sentence each."""

    def transformed(self, similarity: np.ndarray) -> "Views":
        """The same in a world that a 4 x 4 similarity maps this one into."""
        tracks = None if self.tracks is None else self.tracks.transformed(similarity)
        return replace(self, views=tuple(view.transformed(similarity) for view in self.views), tracks=tracks)


def rigid_pose(matrix: Any, name: str) -> np.ndarray:
    """T_world_camera (4, 4) of a 3 x 4 or 4 x 4 matrix, its rotation made exact.

    Raises CaptureError, which names the photograph, for a matrix that is no pose.
    """
    rows = array_of(matrix)
    if rows.shape not in ((3, 4), (4, 4)):
        raise CaptureError(f"the pose of {name} is not a matrix of 3 x 4 or 4 x 4 numbers")
    if not (np.abs(rows) < LARGEST).all():
        raise CaptureError(f"the pose of {name} has numbers that are not finite, or beyond measure")
    pose = np.eye(4)
    left, sizes, right = np.linalg.svd(rows[:3, :3])
    scale = sizes.mean()
    if sizes[2] < _SKEWED * max(sizes[0], 1e-12) or np.abs(sizes - scale).max() > _SKEWED * scale:
        raise CaptureError(f"the pose of {name} is singular or skewed: its 3 x 3 part is no rotation")
    pose[:3, :3], pose[:3, 3] = left @ right, rows[:3, 3]
    if np.linalg.det(pose[:3, :3]) < 0:
        raise CaptureError(f"the pose of {name} is mirrored: its 3 x 3 part has a negative determinant")
    return pose


def array_of(entry: Any) -> np.ndarray:
    """The numbers of an entry of JSON, in double precision; an empty array for all else."""
    try:
        return np.array(entry, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        return np.zeros(0)


def read_description(path: Path, kind: type[R]) -> tuple[R, KeyReport]:
    """Read a file of JSON into a struct of type `kind`. Raises CaptureError where it does not fit."""
    try:
        return read_record(path, kind)
    except InvalidInputError as error:
        raise CaptureError(str(error)) from error


def read_json(path: Path) -> dict[str, Any]:
    """The object in a file. Raises CaptureError where there is none."""
    try:
        head = parse_json(read_text(path), path)
    except InvalidInputError as error:
        raise CaptureError(str(error)) from error
    if not isinstance(head, dict):
        raise CaptureError(f"{path} is JSON, but not the description of a capture")
    return head

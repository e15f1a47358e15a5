"""Camera models: project points into pixels, and pixels into rays. Only here is it said how a camera's axes point.

Cameras are OpenGL: x right, y up, looking along -z. Pixel (u, v) has its centre at (u + 0.5, v + 0.5), u to the
right and v down, so rays of an H x W image are those of pixels v = 0..H-1, u = 0..W-1.
"""

import math
from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.structs import TensorStruct
from nerfnav.geometry.lens import COUNTS, fisheye_directions, undistorted

R_BODY_CAMERA = torch.tensor([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Attitude of a camera that looks along the body's x axis (FLU) with its top towards the body's z axis."""


@dataclass(frozen=True)
class Pose(TensorStruct):
    """A rigid placement of a frame in its parent: x_parent = rotation x + position."""

    rotation: Float[Tensor, "*batch 3 3"]
    """Attitude, e.g. R_world_camera."""
    position: Float[Tensor, "*batch 3"]
    """Origin of the frame in its parent [m]."""

    def compose(self, child: "Pose") -> "Pose":
        """The pose of `child`, given in this frame, in this frame's parent."""
        rotated = (self.rotation @ child.position[..., None]).squeeze(-1)
        return Pose(self.rotation @ child.rotation, self.position + rotated)


FORWARD_MOUNT = Pose(R_BODY_CAMERA, torch.zeros(3))
"""T_body_camera of a camera at the body's origin, looking forward."""


LARGEST_SIDE = 65536
"""Bound of the width and the height of a picture [pixels]."""
_FOCAL = (1e-4, 1e4)
"""Bounds of focal lengths, in widths and heights: views of 179.98 degrees to 20 seconds of arc."""
_FARTHEST = 1e4
"""Bound of the distance of a principal point from the picture, in widths and heights: pictures may be cut from one."""


def require_lens(focal: tuple[float, float], center: tuple[float, float]) -> None:
    """Raise InvalidInputError for focal lengths or a principal point, in widths and heights, that no camera has.

    Rays are computed in single precision, which overflows beyond the bounds.
    """
    if not all(_FOCAL[0] <= length <= _FOCAL[1] for length in focal):
        shown = " and ".join(f"{length:g}" for length in focal)
        raise InvalidInputError(
            f"focal lengths are above 0 pixels, and {_FOCAL[0]:g} to {_FOCAL[1]:g} times the picture's width and "
            f"height, not {shown} times"
        )
    if not all(abs(share) <= _FARTHEST for share in center):
        raise InvalidInputError(
            f"the principal point is {center[0]:g} widths and {center[1]:g} heights from the picture's corner: it "
            f"lies within {_FARTHEST:g}"
        )


@dataclass(frozen=True)
class Camera:
    """Intrinsics of an image of `height` x `width` pixels: a pinhole's, and perhaps a lens's distortion."""

    width: int
    """[pixels]"""
    height: int
    """[pixels]"""
    fx: float
    """Focal length along u [pixels]."""
    fy: float
    """Focal length along v [pixels]."""
    cx: float
    """Principal point along u [pixels]."""
    cy: float
    """Principal point along v [pixels]."""
    distortion: tuple[float, ...] = ()
    """OpenCV's k1, k2, p1, p2 and perhaps k3 (see geometry/lens.py); none: straight lines stay straight.
    Of a fisheye, k1, k2, k3, k4 (see geometry/lens.py)."""
    fisheye: bool = False
    """The lens is a fisheye: a pixel stands for an angle, not for a point of a plane."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for a size or a lens that no camera has, and for a distortion of another model."""
        if not (1 <= self.width <= LARGEST_SIDE and 1 <= self.height <= LARGEST_SIDE):
            raise InvalidInputError(
                f"a picture is 1 to {LARGEST_SIDE} pixels wide and high, not {self.width:g} x {self.height:g}"
            )
        require_lens((self.fx / self.width, self.fy / self.height), (self.cx / self.width, self.cy / self.height))
        counts = (4,) if self.fisheye else COUNTS
        if len(self.distortion) not in counts or not all(map(math.isfinite, self.distortion)):
            raise InvalidInputError(
                f"a distortion has 4 or 5 finite numbers, k1, k2, p1, p2 and perhaps k3, and a fisheye k1 to k4, "
                f"not {self.distortion}"
            )

    @classmethod
    def from_fov(cls, width: int, height: int, horizontal_fov_deg: float) -> "Camera":
        """A camera with square pixels and a centred principal point."""
        if width < 1 or height < 1 or not 0 < horizontal_fov_deg < 180:
            raise InvalidInputError(
                f"a camera needs a positive size and a field of view between 0 and 180 degrees, "
                f"not {width} x {height} at {horizontal_fov_deg}"
            )
        focal = 0.5 * width / math.tan(math.radians(horizontal_fov_deg) / 2)
        return cls(width, height, focal, focal, width / 2, height / 2)

    @property
    def numbers(self) -> tuple[float, ...]:
        """Width, height, fx, fy, cx, cy [pixels], then the distortion, as files keep a camera.

        A fisheye's four numbers are followed by two zeros, for Brown's distortion has five numbers at most.
        """
        beyond = (0.0, 0.0) if self.fisheye else ()
        return self.width, self.height, self.fx, self.fy, self.cx, self.cy, *self.distortion, *beyond

    @classmethod
    def of_numbers(cls, numbers: tuple[float, ...]) -> "Camera":
        """The camera of `numbers`."""
        width, height, fx, fy, cx, cy, *distortion = numbers
        fisheye = len(distortion) > max(COUNTS)
        return cls(int(width), int(height), fx, fy, cx, cy, tuple(distortion[:4] if fisheye else distortion), fisheye)

    def for_picture(self, width: int, height: int) -> "Camera":
        """The same camera at the resolution of a picture [pixels]: several resolutions of one camera are one camera.

        Raises InvalidInputError for a picture of other proportions, which was cut or turned.
        """
        if abs(self.width * height - self.height * width) > max(self.width, self.height, width, height):  # a pixel
            raise InvalidInputError(
                f"the camera was calibrated with {self.width} x {self.height} pixels, and the picture has "
                f"{width} x {height}: give a picture of the same proportions, neither cut nor turned"
            )
        return self.resized(width, height)

    @property
    def aspect(self) -> float:
        """Width over height of its pictures."""
        return self.width / self.height

    @property
    def horizontal_fov_deg(self) -> float:
        """Horizontal field of view, without a distortion [degrees]."""
        edges = self.cx / self.fx, (self.width - self.cx) / self.fx
        return math.degrees(sum(edges if self.fisheye else map(math.atan, edges)))

    def magnified(self, factor: float) -> "Camera":
        """The same sensor behind a lens of `factor` times the focal length."""
        return replace(self, fx=factor * self.fx, fy=factor * self.fy)

    def scaled(self, factor: float) -> "Camera":
        """The same view with `factor` times as many pixels along each side."""
        return self.resized(max(1, round(self.width * factor)), max(1, round(self.height * factor)))

    def resized(self, width: int, height: int) -> "Camera":
        """The same view with so many pixels along each side."""
        along_u, along_v = width / self.width, height / self.height
        focal, center = (self.fx * along_u, self.fy * along_v), (self.cx * along_u, self.cy * along_v)
        return Camera(width, height, *focal, *center, self.distortion, self.fisheye)

    def pixels(self) -> Int[Tensor, "hw 2"]:
        """All pixels (u, v), row by row."""
        v, u = torch.meshgrid(torch.arange(self.height), torch.arange(self.width), indexing="ij")
        return torch.stack([u, v], -1).reshape(-1, 2)

    def directions(self, pixels: Int[Tensor, "*batch 2"]) -> Float[Tensor, "*batch 3"]:
        """Unit viewing directions of the pixels' centres in the camera's frame."""
        u, v = pixels[..., 0] + 0.5, pixels[..., 1] + 0.5
        flat = torch.stack([(u - self.cx) / self.fx, (v - self.cy) / self.fy], -1)
        if self.fisheye:
            return fisheye_directions(flat, self.distortion) * flat.new_tensor([1.0, -1.0, -1.0])
        x, down = (undistorted(flat, self.distortion) if self.distortion else flat).unbind(-1)
        return torch.nn.functional.normalize(torch.stack([x, -down, -torch.ones_like(x)], -1), dim=-1)

    def rays(
        self, pose: Pose, pixels: Int[Tensor, "n 2"] | None = None
    ) -> tuple[Float[Tensor, "n 3"], Float[Tensor, "n 3"]]:
        """Origins [m] and unit directions in the world of the given pixels (default: all, row by row).

        `pose` is T_world_camera, without batch dimensions; gradients flow to it.
        """
        in_camera = self.directions(self.pixels() if pixels is None else pixels).to(pose.position)
        directions = in_camera @ pose.rotation.transpose(-1, -2)
        return pose.position.expand_as(directions), directions

    def project(self, pose: Pose, points: Float[Tensor, "n 3"]) -> tuple[Float[Tensor, "n 2"], Bool[Tensor, " n"]]:
        """Project points in the world [m] to (u, v) [pixels], and mark those that lie within the picture.

        `pose` is T_world_camera. A distortion is left out. Points beside or behind the camera stand nowhere: NaN.
        """
        in_camera = (points - pose.position) @ pose.rotation
        depth = -in_camera[:, 2]
        flat = torch.stack([in_camera[:, 0], -in_camera[:, 1]], -1) / depth.where(depth > 0, torch.nan)[:, None]
        uv = flat * flat.new_tensor([self.fx, self.fy]) + flat.new_tensor([self.cx, self.cy])
        return uv, ((uv >= 0) & (uv < flat.new_tensor([self.width, self.height]))).all(-1)


def look_at(eye: Float[Tensor, "*batch 3"], target: Float[Tensor, "*batch 3"]) -> Pose:
    """T_world_camera of a camera at `eye` [m] looking at `target` [m], its top towards the world's z axis."""
    backward = torch.nn.functional.normalize(eye - target, dim=-1)
    along_x, along_z = eye.new_tensor([1.0, 0.0, 0.0]), eye.new_tensor([0.0, 0.0, 1.0])
    up = torch.where(backward[..., 2:].abs() > 0.999, along_x, along_z)
    right = torch.nn.functional.normalize(torch.linalg.cross(up, backward), dim=-1)
    return Pose(torch.stack([right, torch.linalg.cross(backward, right), backward], -1), eye)


def fibonacci_directions(heights: Float[Tensor, " n"]) -> Float[Tensor, "n 3"]:
    """Unit directions with these z, each turned by the golden angle against the one before (Fibonacci's spiral).

    Spread evenly over the sphere where the heights are spread evenly from -1 to 1, or over a part of it.
    """
    turn = torch.arange(len(heights)) * (math.pi * (3 - math.sqrt(5)))
    level = (1 - heights.square()).clamp_min(0).sqrt()
    return torch.stack([level * turn.cos(), level * turn.sin(), heights], -1)

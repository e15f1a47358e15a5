"""Posed images: photographs with known poses, from which fields are trained, with depth maps and sparse points.

Sightings are the tracks of structure from motion: points of a place, and the images that show each of them.
"""

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
import torch
from jaxtyping import Bool, Float, Int, UInt8
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry.camera import Camera, Pose


@dataclass(frozen=True)
class Sightings:
    """Points, and which images show which of them."""

    points: Float[Tensor, "m 3"]
    """Positions in the world [m]."""
    image: Int[Tensor, " k"]
    """Of each sighting, which image."""
    point: Int[Tensor, " k"]
    """Of each sighting, which point that image shows."""

    def __len__(self) -> int:
        """Number of sightings of points."""
        return len(self.image)

    def of_images(self, chosen: Int[Tensor, " n"]) -> "Sightings":
        """Those of the `chosen` images, which are numbered in this order from then on; all points stay."""
        known = torch.cat([self.image, chosen])
        number = torch.full((int(known.max()) + 1 if len(known) else 0,), -1)
        number[chosen] = torch.arange(len(chosen))
        image = number[self.image]
        return Sightings(self.points, image[image >= 0], self.point[image >= 0])

    def where(self, kept: Tensor) -> "Sightings":
        """The sightings of those points alone for which `kept` (m) is true."""
        number = kept.long().cumsum(0) - 1
        chosen = kept[self.point]
        return Sightings(self.points[kept], self.image[chosen], number[self.point[chosen]])


@dataclass(frozen=True)
class PosedImages:
    """Images of one camera, each with the pose that it was taken from."""

    images: UInt8[Tensor, "n height width 3"]
    """sRGB colours, 0 to 255."""
    camera: Camera
    """Intrinsics, the same for all images."""
    poses: Pose
    """T_world_camera of each image; batch shape (n,)."""
    depth: Float[Tensor, "n depth_height depth_width"] | None = None
    """Depth along each pixel's ray [m], for pixels of the same view that may be more or fewer than the images';
    infinite where the ray meets nothing, 0 where there is no measurement. None: no depth is known."""
    depth_noise: float = 0.0
    """Relative error of depths; 0 for those of a renderer."""
    silhouettes: Bool[Tensor, "n height width"] | None = None
    """Masks of pictures that are cut out: pixels on or beside what they show; None where they are not cut out."""
    sightings: Sightings | None = None
    """Points that structure from motion found in the images; None where it found none."""
    mask: Bool[Tensor, "n height width"] | None = None
    """Pixels that count, in learning, in proofs of free space and in judging; None: all. Depth is 0 at the others."""

    def __len__(self) -> int:
        """Number of images."""
        return self.images.shape[0]

    def subset(self, index: "list[int] | slice") -> "PosedImages":
        """The images at `index`, with their poses."""
        depth = None if self.depth is None else self.depth[index]
        shown = None if self.silhouettes is None else self.silhouettes[index]
        mask = None if self.mask is None else self.mask[index]
        sightings = None if self.sightings is None else self.sightings.of_images(torch.arange(len(self))[index])
        return replace(
            self, images=self.images[index], poses=self.poses[index], depth=depth, silhouettes=shown,
            sightings=sightings,
            mask=mask,
        )  # fmt: skip

    def shrunk(self, longest: int) -> "PosedImages":
        """The images with at most so many pixels along each side, each the mean of a whole number of pixels squared.

        A pixel counts where all of its pixels do. Depths stay as they are.
        """
        factor = -(-max(self.camera.width, self.camera.height) // longest)
        if factor == 1:
            return self
        size = max(1, self.camera.width // factor), max(1, self.camera.height // factor)
        images = [cv2.resize(image.numpy(), size, interpolation=cv2.INTER_AREA) for image in self.images]
        shown, mask = (
            None if each is None else _shares(each, size) for each in (self.silhouettes, self.mask)
        )  # fmt: skip
        return replace(
            self, images=torch.from_numpy(np.stack(images)), camera=self.camera.resized(*size),
            silhouettes=None if shown is None else shown > 0, mask=None if mask is None else mask == 1,
        )  # fmt: skip

    @property
    def depth_camera(self) -> Camera:
        """The camera of the depths. Raises ValueError where there are none."""
        if self.depth is None:
            raise ValueError("these images have no depth")
        return self.camera.resized(self.depth.shape[2], self.depth.shape[1])

    def without_depth(self) -> "PosedImages":
        """The same images without their depth."""
        return replace(self, depth=None)


def _shares(masks: Bool[Tensor, "n h w"], size: tuple[int, int]) -> Float[Tensor, "n height width"]:
    """Share of each pixel of fewer pixels, (width, height), that is set."""
    resized = [cv2.resize(mask.numpy().astype(np.float32), size, interpolation=cv2.INTER_AREA) for mask in masks]
    return torch.from_numpy(np.stack(resized))


def count_outside_silhouettes(
    photographs: PosedImages, points: Float[Tensor, "m 3"]
) -> tuple[Float[Tensor, " m"], Float[Tensor, " m"]]:
    """By how many photographs each point [m] is seen clear of all silhouettes, and by how many it is seen at all."""
    assert photographs.silhouettes is not None, "these photographs are not cut out"
    clear, seen = torch.zeros(len(points)), torch.zeros(len(points))
    for index, silhouette in enumerate(photographs.silhouettes):
        uv, inside = photographs.camera.project(photographs.poses[index], points)
        u, v = uv[inside].long().unbind(-1)
        seen += inside
        clear[inside] += ~silhouette[v, u]
    return clear, seen


def downsample_image(image: UInt8[Tensor, "height width 3"], camera: Camera) -> Float[Tensor, "hw 3"]:
    """The colours in [0, 1] that a camera with fewer pixels sees, each the mean over its area, row by row."""
    size = camera.width, camera.height
    small = cv2.resize(image.cpu().numpy().astype(np.float32), size, interpolation=cv2.INTER_AREA)
    return torch.from_numpy(small.reshape(-1, 3)).to(image.device) / 255


def encode_image(image: UInt8[np.ndarray, "height width 3"], jpeg_quality: int | None = None) -> bytes:
    """sRGB colours as a PNG file, or as a JPEG of a quality from 1 to 100: from 90 on without chroma subsampling."""
    kind, settings = (".png", []) if jpeg_quality is None else (".jpg", [cv2.IMWRITE_JPEG_QUALITY, jpeg_quality])
    if jpeg_quality is not None and jpeg_quality >= 90:
        settings += [cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444]
    done, encoded = cv2.imencode(kind, np.ascontiguousarray(image[..., ::-1]), settings)
    assert done, "every picture of bytes can be a PNG or JPEG"
    return encoded.tobytes()


def psnr_db(mean_squared_error: float) -> float:
    """Peak signal-to-noise ratio [dB] of colours in [0, 1]; 100 where they agree."""
    return -10 * math.log10(max(mean_squared_error, 1e-10))


def check_image(image: Tensor, camera: Camera) -> None:
    """Raise InvalidInputError unless `image` is a uint8 RGB picture of the camera's size."""
    wanted = (camera.height, camera.width, 3)
    if image.dtype != torch.uint8 or tuple(image.shape) != wanted:
        raise InvalidInputError(
            f"this camera takes uint8 pictures of {wanted[0]} x {wanted[1]} x 3 (height x width x RGB), not "
            f"{str(image.dtype).removeprefix('torch.')} of {' x '.join(map(str, image.shape))}"
        )

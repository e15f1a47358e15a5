"""Surface colours of a mesh: vertex colours, face colours or a texture, or paint with a texture for each part.

With paint, each face knows its image and no images are joined: joining them into one would break those that repeat,
and costs as much memory again.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Float32, Int32, Shaped, UInt8
from trimesh.visual.color import ColorVisuals
from trimesh.visual.texture import TextureVisuals

from nerfnav.core.jit import kernel

Colors = Float32[np.ndarray, "n 3"]
Faces = Int32[np.ndarray, " n"]
Barycentric = Float32[np.ndarray, "n 3"]

SurfaceColor = Callable[[Faces, Barycentric], Colors]
"""Colours (sRGB, 0 to 255) at points given by their face and their weights of its three corners; of face -1, which is
none, any colour."""


def surface_color(mesh: trimesh.Trimesh) -> SurfaceColor:
    """The colours of a mesh, whichever way it stores them; grey where it stores none."""
    visual = mesh.visual
    if isinstance(visual, TextureVisuals):
        image, tint = _material(visual.material)
        if image is None or visual.uv is None:
            return lambda faces, weights: np.tile(tint, (len(faces), 1))
        return _textured(image, tint, np.asarray(visual.uv, np.float32)[mesh.faces])
    assert isinstance(visual, ColorVisuals)  # trimesh knows no third kind
    if visual.kind == "face":
        flat = np.asarray(visual.face_colors[:, :3], np.float32)
        return lambda faces, weights: flat[faces]
    corners = np.asarray(visual.vertex_colors[:, :3], np.float32)[mesh.faces]
    return lambda faces, weights: interpolate(corners, faces, weights)


def interpolate(corners: Shaped[np.ndarray, "f 3 c"], faces: Faces, weights: Barycentric) -> Float32[np.ndarray, "n c"]:
    """Blend the values at each face's corners."""
    values = np.empty((len(faces), corners.shape[2]), np.float32)
    blend(corners, faces, weights, values)
    return values


def _textured(
    image: Shaped[np.ndarray, "h w 3"],
    tint: Float32[np.ndarray, " 3"],
    uv_corners: Float32[np.ndarray, "f 3 2"],
) -> SurfaceColor:
    def color(faces: Faces, weights: Barycentric) -> Colors:
        colors, seen = np.zeros((len(faces), 3), np.float32), faces >= 0
        colors[seen] = bilinear(image, interpolate(uv_corners, faces[seen], weights[seen])) * (tint / 255)
        return colors

    return color


def bilinear(image: Shaped[np.ndarray, "h w 3"], uv: Float32[np.ndarray, "n 2"]) -> Colors:
    """Look-up in an image that repeats; v points up, rows of the image point down."""
    colors = np.empty((len(uv), 3), np.float32)
    look_up(image, uv, colors)
    return colors


def _material(material: object) -> tuple[np.ndarray | None, np.ndarray]:
    """The image of a material, if it has one, and the colour (0 to 255) that tints it."""
    image = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
    factor = getattr(material, "baseColorFactor", None)
    if factor is None and image is None:
        factor = getattr(material, "main_color", None)
    tint = np.full(3, 255, np.float32) if factor is None else np.asarray(factor[:3], np.float32)
    pixels = None if image is None else np.asarray(image.convert("RGB"), np.float32)
    return pixels, tint


Image = UInt8[np.ndarray, "_ _ 3"]
"""sRGB; rows point down."""


@dataclass(frozen=True, eq=False)
class Paint:
    """Paint of the f faces of a mesh: an image or none, times a tint."""

    images: tuple[Image, ...]
    """The textures, each held once however many parts it paints."""
    image_of_face: Int32[np.ndarray, " f"]
    """Index into `images`; -1 where a face has no image and its tint alone is its colour."""
    uv: Float32[np.ndarray, "f 3 2"]
    """Texture coordinates of each face's corners; images repeat, and v points up."""
    tint: UInt8[np.ndarray, "f 3 3"]
    """sRGB colour at each face's corners."""

    def color(self, faces: Faces, weights: Barycentric) -> Colors:
        """sRGB, 0 to 255, at points given by their face and their weights of its three corners; of face -1, which is
        none, any colour."""
        colors = interpolate(self.tint, faces, weights)
        image = np.where(faces >= 0, self.image_of_face[faces], -1)
        for index in np.unique(image[image >= 0]):
            here = image == index
            uv = interpolate(self.uv, faces[here], weights[here])
            colors[here] *= bilinear(self.images[index], uv) * np.float32(1 / 255)
        return colors


def paint_of(mesh: trimesh.Trimesh) -> Paint:
    """Convert the colours of a mesh to paint, whichever way it stores them; they look the same."""
    count, visual = len(mesh.faces), mesh.visual
    uv = np.zeros((count, 3, 2), np.float32)
    if isinstance(visual, TextureVisuals):
        image, tint = _material(visual.material)
        tints = np.tile(np.rint(tint).astype(np.uint8), (count, 3, 1))
        if image is not None and visual.uv is not None:
            uv = np.asarray(visual.uv, np.float32)[mesh.faces]
            return Paint((image.astype(np.uint8),), np.zeros(count, np.int32), uv, tints)
    else:
        corners = np.repeat(np.arange(count, dtype=np.int32), 3)
        weights = np.tile(np.eye(3, dtype=np.float32), (count, 1))
        tints = np.rint(surface_color(mesh)(corners, weights)).astype(np.uint8).reshape(count, 3, 3)
    return Paint((), np.full(count, -1, np.int32), uv, tints)


@kernel(exact=True)
def blend(corners, faces, weights, values):
    """Fill values (n, c): those at the corners (f, 3, c) of the faces (n,), by their weights (n, 3).

    Nothing is reordered or fused: a byte that rounds the other way would be another flight of the same seed.
    """
    for ray in range(faces.shape[0]):
        at = corners[faces[ray]]
        for channel in range(values.shape[1]):
            first = weights[ray, 0] * np.float32(at[0, channel])
            second = weights[ray, 1] * np.float32(at[1, channel])
            values[ray, channel] = first + second + weights[ray, 2] * np.float32(at[2, channel])


@kernel(exact=True)
def look_up(image, uv, colors):
    """Fill colors (n, 3): those of an image (h, w, 3) that repeats at texture coordinates (n, 2), linear between
    pixels."""
    height, width = image.shape[:2]
    one, half = np.float32(1), np.float32(0.5)
    for ray in range(uv.shape[0]):
        x = uv[ray, 0] * np.float32(width) - half
        y = (one - uv[ray, 1]) * np.float32(height) - half
        left, top = math.floor(x), math.floor(y)
        along_x, along_y = x - np.float32(left), y - np.float32(top)
        above, below = image[top % height], image[(top + 1) % height]
        first, second = left % width, (left + 1) % width
        for channel in range(3):
            upper = (one - along_x) * np.float32(above[first, channel]) + along_x * np.float32(above[second, channel])
            lower = (one - along_x) * np.float32(below[first, channel]) + along_x * np.float32(below[second, channel])
            colors[ray, channel] = (one - along_y) * upper + along_y * lower

"""Colours of a mesh whose parts have textures of their own: each face knows its image, none is joined with another.

Joining images into one would break those that repeat, and costs as much memory again.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Int32, UInt8

from nerfnav.world.surface import Barycentric, Colors, Faces, bilinear, interpolate

Image = UInt8[np.ndarray, "_ _ 3"]
"""sRGB; rows point down."""


@dataclass(frozen=True, eq=False)
class Paint:
    """What colours the f faces of a mesh: an image or none, times a tint."""

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

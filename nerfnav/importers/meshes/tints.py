"""Tints: plain colours of a mesh's faces, whatever its file calls them."""

import numpy as np
import trimesh
from jaxtyping import Int, Shaped, UInt8
from trimesh.visual.color import ColorVisuals
from trimesh.visual.material import SimpleMaterial
from trimesh.visual.texture import TextureVisuals

from nerfnav.geometry import to_srgb

GREY = 178
"""sRGB brightness of what has no colour at all."""


def tint_of(mesh: trimesh.Trimesh, faces: Int[np.ndarray, "f 3"], linear: bool) -> UInt8[np.ndarray, "f 3 3"]:
    """sRGB at each face's corners: the material's colour times those of faces or vertices."""
    visual, count = mesh.visual, len(faces)
    if not isinstance(visual, TextureVisuals):
        assert isinstance(visual, ColorVisuals)  # trimesh knows no third kind
        if visual.kind == "face":
            return np.repeat(_bytes(visual.face_colors, False)[:, None], 3, 1)
        if visual.kind == "vertex":
            return _bytes(visual.vertex_colors, linear)[faces]
        return np.full((count, 3, 3), GREY, np.uint8)
    tint = np.broadcast_to(_factor(visual.material, linear), (count, 3, 3))
    colors = visual.vertex_attributes.get("color")
    if colors is not None and len(colors) == len(mesh.vertices):
        # as sRGB is nearly a power of light, a product of light is a product of sRGB
        tint = (tint.astype(np.float32) * _bytes(colors, linear)[faces] / 255).round().astype(np.uint8)
    return np.ascontiguousarray(tint)


def _factor(material: object, linear: bool) -> UInt8[np.ndarray, " 3"]:
    """What a material multiplies its image with; its colour where it has no image."""
    factor = getattr(material, "baseColorFactor", None)
    if factor is None and getattr(material, "image", None) is None and isinstance(material, SimpleMaterial):
        factor = material.diffuse
    if factor is None:
        return np.full(3, 255, np.uint8)
    return _bytes(np.asarray(factor)[None], linear)[0]


def _bytes(colors: Shaped[np.ndarray, "n c"], linear: bool) -> UInt8[np.ndarray, "n 3"]:
    """Colours of any type as sRGB bytes: integers fill their range, other numbers lie in [0, 1]."""
    colors = np.asarray(colors)[:, :3]
    largest = np.iinfo(colors.dtype).max if np.issubdtype(colors.dtype, np.integer) else 1
    share = np.clip(np.nan_to_num(colors.astype(float)) / largest, 0, 1)
    return (255 * (to_srgb(share) if linear else share)).round().astype(np.uint8)

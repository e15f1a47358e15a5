"""Texture baking: the mesh of a field with a picture, rendered from straight above each of its points."""

from collections.abc import Generator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy
import torch
from jaxtyping import Float, Int, UInt8

from nerfnav.field.core.protocol import Field
from nerfnav.field.render.volume_rendering import FastRenderer
from nerfnav.field.surface.atlas import atlas_of

if TYPE_CHECKING:
    import trimesh

_MOST_TEXELS = 1 << 22
_AT_ONCE = 1 << 16  # points: 0.1 s, which a hand may wait
_ABOVE = 1.0
"""Rays begin so far above the surface, in lengths of `finest`."""
_DEEPEST, _LEAST_OPACITY = 8.0, 0.5
"""A ray gives the colour of its point where it is stopped, to this share, within so many lengths of `finest`."""


@dataclass(frozen=True)
class TexturedMesh:
    """Triangles with a picture on them."""

    vertices: Float[np.ndarray, "k 3"]
    """World axes [m]; those on the border of charts stand here once for each chart."""
    faces: Int[np.ndarray, "m 3"]
    """Numbers of vertices."""
    uv: Float[np.ndarray, "k 2"]
    """Texture coordinates of each vertex: 0 to 1 from the left, and from the top."""
    picture: UInt8[np.ndarray, "height width 3"]
    """sRGB."""


def texture_mesh(field: Field, mesh: "trimesh.Trimesh", finest: float) -> Generator[None, None, TexturedMesh]:
    """Return a mesh of a field with the field's colours, in texels of half of `finest` [m], its resolution.

    Larger texels where there would be too many of them. Yields now and then, for this takes seconds. Raises
    InvalidInputError for a mesh without triangles.
    """
    vertices, normals = np.asarray(mesh.vertices), np.asarray(mesh.vertex_normals)
    atlas = atlas_of(vertices, np.asarray(mesh.faces), 0.5 * finest, _MOST_TEXELS)
    texels = np.flatnonzero(atlas.face_at >= 0)
    picture = np.zeros((atlas.face_at.size, 3), np.uint8)
    for part in np.array_split(texels, max(1, -(-len(texels) // _AT_ONCE))):
        points, outward = atlas.shown(vertices, part), atlas.shown(normals, part)
        outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-9)
        yield
        seen = _seen_from_above(field, torch.from_numpy(points).float(), torch.from_numpy(outward).float(), finest)
        picture[part] = (seen.clamp(0, 1) * 255).round().to(torch.uint8).numpy()
    yield
    empty = (atlas.face_at < 0).reshape(atlas.size)
    # what nothing shows takes the nearest colour: compressed pictures ring where colours jump
    nearest = scipy.ndimage.distance_transform_edt(empty, return_distances=False, return_indices=True)
    picture = picture.reshape(*atlas.size, 3)[tuple(nearest)]
    uv = (atlas.texels + 0.5) / np.array(atlas.size[::-1], np.float32)
    return TexturedMesh(vertices[atlas.vertices], atlas.faces, uv, picture)


def _seen_from_above(field: Field, points: torch.Tensor, outward: torch.Tensor, finest: float) -> torch.Tensor:
    """Colours (n, 3) of rays along the normals, which begin above points (n, 3) of a surface and go inwards.

    A point that lets most light through, or a field without a renderer of its own (a network takes minutes for so many
    rays), gives the colour of the field half of `finest` below the point.
    """
    with torch.no_grad():
        below = torch.minimum(torch.maximum(points - 0.5 * finest * outward, field.box.lower), field.box.upper)
        colors = field.radiance(below, -outward)
        if not isinstance(field, FastRenderer):
            return colors
        rays = field.render_rays(points + _ABOVE * finest * outward, -outward)
        met = (rays.opacity >= _LEAST_OPACITY) & (rays.depth <= (_DEEPEST + _ABOVE) * finest)
        return torch.where(met[:, None], rays.color, colors)

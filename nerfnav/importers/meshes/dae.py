"""Collada: the parts of a .dae, whose document pycollada reads.

Skins stand in their bind pose and morphs in their base shape: what the document cannot bring over is noted.
"""

import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, UInt8

from nerfnav.core.extras import import_extra
from nerfnav.importers.core.errors import first_line
from nerfnav.importers.meshes.parts import GREY, DamagedMeshError, Part, srgb_bytes
from nerfnav.importers.meshes.polygons import triangulate
from nerfnav.importers.meshes.resolver import FolderResolver, PictureError
from nerfnav.world.surface import Image as Pixels


def read_dae(path: Path, data: bytes, beside: FolderResolver) -> list[Part]:
    """The parts of a Collada document. Raises DamagedMeshError where it is none, or has no scene."""
    if b"<COLLADA" not in data:
        raise DamagedMeshError("is not a .dae file: it holds no COLLADA document")
    if b"<!DOCTYPE" in data or b"<!ENTITY" in data:
        raise DamagedMeshError("defines entities of its own, which a mesh has no need of: it is not read")
    collada = import_extra("collada", "meshes", "a Collada mesh (.dae)")
    try:
        document = collada.Collada(io.BytesIO(data), ignore=[collada.common.DaeError])
    except Exception as error:  # whatever the reader raises over foreign text
        raise DamagedMeshError(f"cannot be read as Collada (cut off or damaged): {first_line(error)}") from error
    if document.scene is None:
        raise DamagedMeshError("is a Collada document without a scene")
    for error in document.errors[:3]:
        beside.note(f"a part of its Collada document is not read: {first_line(error)}")
    pictures: dict[str, Pixels | None] = {}
    parts = (
        (_part(primitive, materials, pictures, beside), matrix)
        for geometry, matrix, materials in _bound(document.scene, beside)
        for primitive in geometry.primitives
    )
    return [part.moved_by(np.asarray(matrix, float)) for part, matrix in parts if part is not None]


def _bound(scene: Any, beside: FolderResolver) -> Iterator[tuple[Any, Any, dict[str, Any]]]:
    """Geometries of a scene, their poses, and their materials by the symbols that they use."""
    for bound in scene.objects("geometry"):
        yield bound.original, bound.matrix, bound.materialnodebysymbol
    for bound in scene.objects("controller"):
        skin = getattr(bound, "geometry", None)
        beside.note(f"its {'skins stand in their bind pose' if skin else 'morphs stand in their base shape'}")
        if skin is not None:
            yield skin.original, skin.matrix, skin.materialnodebysymbol
        else:
            yield bound.original.source_geometry, bound.matrix, bound.materialnodebysymbol


def _part(
    primitive: Any, materials: dict[str, Any], pictures: dict[str, Pixels | None], beside: FolderResolver
) -> Part | None:
    """Triangles, strips, fans or polygons in their own axes; None for lines and for what is empty."""
    if primitive.vertex is None or not (hasattr(primitive, "vcounts") or hasattr(primitive, "ntriangles")):
        return None
    points, corners = np.asarray(primitive.vertex, float), np.asarray(primitive.vertex_index).reshape(-1)
    counts = np.asarray(getattr(primitive, "vcounts", np.full(len(corners) // 3, 3)), np.int64)
    if counts.sum() != len(corners) or corners.min() < 0 or corners.max() >= len(points):
        raise DamagedMeshError("has a face with a corner that does not exist")
    triangles = triangulate(points, corners.astype(np.int64), counts)
    node = materials.get(primitive.material)
    effect = None if node is None else node.target.effect
    diffuse: Any = None if effect is None else effect.diffuse
    index = np.asarray(primitive.index).reshape(len(corners), -1)
    picture, uv = None, None
    if hasattr(diffuse, "sampler"):
        picture = _picture(diffuse.sampler.surface.image.path, pictures, beside)
        uv = _input(primitive, "TEXCOORD", index, _set_of(node, diffuse.texcoord))
        uv = None if uv is None or picture is None else uv[:, :2][triangles]
    tint = np.full((len(triangles), 3, 3), GREY, np.uint8)
    colors = _input(primitive, "COLOR", index, None)
    if uv is not None:
        tint[:] = 255
    elif colors is not None and colors.shape[1] >= 3:
        tint = srgb_bytes(colors, False)[triangles]
    elif isinstance(diffuse, tuple | list | np.ndarray):
        tint[:] = _shade(diffuse)
    return Part(points, corners[triangles], tint, uv, picture)


def _shade(color: Any) -> UInt8[np.ndarray, " 3"]:
    return srgb_bytes(np.asarray(color, float)[None], False)[0]


def _set_of(node: Any, symbol: str) -> str | None:
    """The set of texture coordinates that a material's symbol is bound to; None for the first."""
    return next((number for semantic, _, number in node.inputs if semantic == symbol), None)


def _input(primitive: Any, semantic: str, index: np.ndarray, number: str | None) -> Float[np.ndarray, "c k"] | None:
    """Values of an input at each corner; None where it is missing."""
    inputs = primitive.sources.get(semantic) or []
    if not inputs:
        return None
    offset, _, _, _, source = next((entry for entry in inputs if entry[3] == number), inputs[0])
    chosen = index[:, offset]
    return np.asarray(source.data, float)[chosen] if 0 <= chosen.min() <= chosen.max() < len(source.data) else None


def _picture(name: str, pictures: dict[str, Pixels | None], beside: FolderResolver) -> Pixels | None:
    """A texture, read once; None, and a note, where it cannot be had."""
    if name not in pictures:
        try:
            pictures[name] = beside.picture(name)
        except PictureError as error:
            beside.note(str(error))
            pictures[name] = None
    return pictures[name]

"""Surface GLB: clean a mesh for a browser, and encode it as binary glTF without light, to be shown as it is.

Imports nothing slow: a surface that was kept is shown while all else is being imported.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from nerfnav.core.glb import packed, parts
from nerfnav.geometry import invert_tone_map, to_linear, to_srgb

if TYPE_CHECKING:
    import trimesh  # slow to import, and surfaces are seldom made

    from nerfnav.field.surface.texture import TexturedMesh
    from nerfnav.obstacles import CutOut

_VERTICES, _INDICES = 34962, 34963  # buffer targets of glTF
_FLOAT, _UINT32, _UINT16 = 5126, 5125, 5123  # component types of glTF
_LINEAR, _CLAMP = 9729, 33071  # smaller pictures (mipmaps) would mix what only lies side by side in the atlas
_JPEG_QUALITY = 95
BRIGHTEST = 2.0
"""Light of the brightest texel: after viser's tone mapping, nearly white."""
_CUTS = 100  # heights at which a surface can be cut
_FACES, _SHARE = 12_000, 0.08
"""Of larger surfaces so many faces are left, or this share: 99 of 100 places of the bundled worlds stay within a cell
of marching cubes, half of them within a fifth of one."""

Corner = list[float]
Box = tuple[Corner, Corner] | None


@dataclass(frozen=True)
class _Attribute:
    """Attribute of the corners of a mesh."""

    name: str
    """Name in glTF."""
    values: np.ndarray
    """Shares of 65535, a row for each corner."""


def remove_specks(mesh: "trimesh.Trimesh", least_faces: int) -> "trimesh.Trimesh":
    """The mesh without connected parts of fewer faces: a trained field has specks of fog that only disturb the eye."""
    if len(mesh.faces) == 0:
        return mesh
    edges = mesh.faces[:, [0, 1, 1, 2]].reshape(-1, 2)
    shape = (len(mesh.vertices), len(mesh.vertices))
    graph = scipy.sparse.coo_matrix((np.ones(len(edges), dtype=bool), (edges[:, 0], edges[:, 1])), shape=shape)
    _, part_of_vertex = scipy.sparse.csgraph.connected_components(graph, directed=False)
    part_of_face = part_of_vertex[mesh.faces[:, 0]]
    kept = mesh.copy()
    kept.update_faces(np.bincount(part_of_face)[part_of_face] >= least_faces)
    kept.remove_unreferenced_vertices()
    return kept


def simplified(mesh: "trimesh.Trimesh") -> "trimesh.Trimesh":
    """The mesh with fewer faces, large ones where it is flat (quadric decimation, Garland and Heckbert, 1997).

    A frame that a browser draws in software takes as long as there are faces. Vertices lose their colours, which would
    be smeared over large faces: for meshes that get a texture.
    """
    count = max(_FACES, round(_SHARE * len(mesh.faces)))
    return mesh if len(mesh.faces) <= count else mesh.simplify_quadric_decimation(face_count=count)


def encode_textured_glb(mesh: "TexturedMesh", box: Box = None) -> bytes:
    """A mesh with its picture as binary glTF that viser shows as it is, without light (KHR_materials_unlit).

    viser maps tones, which would make stones chalky: the picture holds what comes out as its colours, in units of
    `BRIGHTEST`. `box`, lower and upper corner [m] of the place that it is of, goes along for `read_box`.
    """
    from nerfnav.geometry import encode_image  # imports torch: see above

    picture = np.round(255 * to_srgb(_light(mesh.picture))).astype(np.uint8)
    uv = np.round(65535 * mesh.uv).astype("<u2")
    painted = {
        "materials": [_material(baseColorTexture={"index": 0})],
        "textures": [{"source": 0, "sampler": 0}],
        "images": [{"bufferView": 3, "mimeType": "image/jpeg"}],
        "samplers": [{"magFilter": _LINEAR, "minFilter": _LINEAR, "wrapS": _CLAMP, "wrapT": _CLAMP}],
    }
    attribute, jpeg = _Attribute("TEXCOORD_0", uv), encode_image(picture, _JPEG_QUALITY)
    return _glb(mesh.vertices, mesh.faces, attribute, painted, box, jpeg)


def encode_colored_glb(mesh: "trimesh.Trimesh", box: Box = None) -> bytes:
    """The same of a mesh with the colours of its vertices: not as sharp, but made in a moment."""
    colors = np.full((len(mesh.vertices), 4), 65535, "<u2")  # 16 bits, or dark ones show bands
    colors[:, :3] = np.round(65535 * _light(_vertex_colors(mesh)))
    return _glb(mesh.vertices, mesh.faces, _Attribute("COLOR_0", colors), {"materials": [_material()]}, box)


def _light(colors: np.ndarray) -> np.ndarray:
    """Linear colours that viser shows as these sRGB bytes (..., 3), in units of `BRIGHTEST`."""
    # 32 bits tell apart more than bytes do, in a quarter of the time
    return (invert_tone_map(to_linear(colors / np.float32(255))) / BRIGHTEST).clip(0, 1)


def _material(**more: Any) -> dict[str, Any]:
    factor = {"baseColorFactor": [BRIGHTEST] * 3 + [1]}
    return {"pbrMetallicRoughness": factor | more, "extensions": {"KHR_materials_unlit": {}}}


def _glb(
    corners: np.ndarray, triangles: np.ndarray, attribute: _Attribute, painted: dict[str, Any], box: Box,
    picture: bytes = b"",
) -> bytes:  # fmt: skip
    """Binary glTF of a mesh whose corners have an attribute; `painted` goes along."""
    name, values = attribute.name, attribute.values
    vertices = np.ascontiguousarray(corners, dtype="<f4")
    faces, below = _by_height(vertices, np.asarray(triangles))
    parts = [vertices.tobytes(), values.tobytes(), faces.tobytes(), *([picture] if picture else [])]
    offsets = np.cumsum([0, *map(len, parts)]).tolist()
    targets = ({"target": _VERTICES}, {"target": _VERTICES}, {"target": _INDICES}, {})  # a picture has none
    views = [
        {"buffer": 0, "byteOffset": offset, "byteLength": len(part), **target}
        for offset, part, target in zip(offsets, parts, targets, strict=False)
    ]
    low, high = vertices.min(0).tolist(), vertices.max(0).tolist()
    kind = f"VEC{values.shape[1]}"
    accessors = [
        {"bufferView": 0, "componentType": _FLOAT, "count": len(vertices), "type": "VEC3", "min": low, "max": high},
        {"bufferView": 1, "componentType": _UINT16, "normalized": True, "count": len(vertices), "type": kind},
        {"bufferView": 2, "componentType": _UINT32, "count": faces.size, "type": "SCALAR"},
    ]
    primitive = {"attributes": {"POSITION": 0, name: 1}, "indices": 2, "material": 0, "extras": {"below": below}}
    return packed(
        {
            "asset": {"version": "2.0"},
            "extensionsUsed": ["KHR_materials_unlit"],
            "scene": 0,
            "scenes": [{"nodes": [0], "extras": {"box": box}}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [primitive]}],
            "buffers": [{"byteLength": offsets[-1]}],
            "bufferViews": views,
            "accessors": accessors,
            **painted,
        },
        b"".join(parts),
    )


def read_box(glb: bytes) -> Box:
    """Read the lower and upper corner [m] of the place from its surface; None where it has none."""
    box = parts(glb)[0]["scenes"][0]["extras"]["box"]
    return None if box is None else (box[0], box[1])


def clip_and_fade(glb: bytes, opacity: float, clip: float) -> bytes:
    """A surface from `encode_textured_glb`, less opaque (0 to 1), and without what is above a share `clip` of its
    height."""
    document, binary = parts(glb)
    (primitive,) = document["meshes"][0]["primitives"]
    indices = document["accessors"][primitive["indices"]]
    # the faces stand in the order of their heights: what is cut off are the last ones
    indices["count"] = max(3, 3 * primitive["extras"]["below"][round(_CUTS * clip)])
    if opacity < 1:
        document["materials"][0]["alphaMode"] = "BLEND"
        document["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"][3] = opacity
    return packed(document, binary)


def split_glb(glb: bytes, shape: "CutOut", inside: bool) -> bytes:
    """The faces of a surface whose middles are inside the volume of a cut-out, where it was cut out; or all others."""
    document, binary = parts(glb)
    (primitive,) = document["meshes"][0]["primitives"]
    corners, indices = (
        document["accessors"][index] for index in (primitive["attributes"]["POSITION"], primitive["indices"])
    )
    at, first = (document["bufferViews"][each["bufferView"]]["byteOffset"] for each in (corners, indices))
    vertices = np.frombuffer(binary, "<f4", 3 * corners["count"], at).reshape(-1, 3)
    faces = np.frombuffer(binary, "<u4", indices["count"], first).reshape(-1, 3)
    kept = faces[(shape.source.signed_distance(vertices[faces].mean(1).astype(float)) <= 0) == inside]
    if len(kept) == 0:
        kept = np.zeros((1, 3), "<u4")  # browsers take no mesh without a face: this one has no area
    indices["count"] = kept.size
    data = np.ascontiguousarray(kept, "<u4").tobytes()
    return packed(document, binary[:first] + data + binary[first + len(data) :])


def _by_height(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, list[int]]:
    """Faces in the order of their highest vertices, and how many are below each percent of the height."""
    if len(faces) == 0:
        return np.zeros((0, 3), "<u4"), [0] * (_CUTS + 1)
    height = vertices[faces, 2].max(1)
    order = np.argsort(height, kind="stable")
    cuts = np.linspace(vertices[:, 2].min(), vertices[:, 2].max(), _CUTS + 1)
    below = np.searchsorted(height[order], cuts, side="right")
    return np.ascontiguousarray(faces[order], dtype="<u4"), [*below[:-1].tolist(), len(faces)]


def _vertex_colors(mesh: "trimesh.Trimesh") -> np.ndarray:
    """sRGB bytes (n, 3)."""
    from trimesh.visual.color import ColorVisuals

    assert isinstance(mesh.visual, ColorVisuals), "surfaces of fields have colours at their vertices"
    return np.asarray(mesh.visual.vertex_colors)[:, :3]

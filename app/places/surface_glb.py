"""A mesh made ready for a browser: cleaned, and as bytes that are shown as they are (binary glTF without light).

Imports nothing slow: a surface that was kept is shown while all else is being imported.
"""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import scipy

import nerfnav
from nerfnav import cached
from nerfnav.geometry import to_linear
from nerfnav.glb import packed, parts

if TYPE_CHECKING:
    import trimesh  # slow to import, and surfaces are seldom made

_VERTICES, _INDICES = 34962, 34963  # buffer targets of glTF
_FLOAT, _UINT32, _UINT16 = 5126, 5125, 5123  # component types of glTF
_KIND = "surfaces"  # in the cache
_CUTS = 100  # heights at which a surface can be cut
_CODE = Path(__file__).parent, Path(nerfnav.__file__).parent / "field"  # which surfaces depend on

Corner = list[float]


def kept_surface(field: Path, shape: Callable[[], bytes] | None = None) -> bytes | None:
    """The surface of a field's file, shaped once on this machine; without `shape`, None where it never was.

    None where it is empty, too.
    """
    key = cached.code_of(*_CODE) + hashlib.sha256(field.read_bytes()).digest()
    return (cached.found(_KIND, key) if shape is None else cached.kept(_KIND, key, shape)) or None


def without_specks(mesh: "trimesh.Trimesh", least_faces: int) -> "trimesh.Trimesh":
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


def unlit_glb(mesh: "trimesh.Trimesh", box: tuple[Corner, Corner] | None = None) -> bytes:
    """A mesh with vertex colours as binary glTF that viewers show as it is, without light (KHR_materials_unlit).

    `box`, lower and upper corner [m] of the place that it is of, goes along for `box_of`.
    """
    vertices = np.ascontiguousarray(mesh.vertices, dtype="<f4")
    faces, below = _by_height(vertices, np.asarray(mesh.faces))
    # colours of glTF are linear; 16 bits, or dark ones show bands
    colors = np.full((len(vertices), 4), 65535, dtype="<u2")
    colors[:, :3] = np.round(65535 * to_linear(_vertex_colors(mesh) / 255.0))
    parts = [vertices.tobytes(), colors.tobytes(), faces.tobytes()]
    offsets = np.cumsum([0, *map(len, parts)]).tolist()
    views = [
        {"buffer": 0, "byteOffset": offset, "byteLength": len(part), "target": target}
        for offset, part, target in zip(offsets, parts, (_VERTICES, _VERTICES, _INDICES), strict=False)
    ]
    low, high = vertices.min(0).tolist(), vertices.max(0).tolist()
    accessors = [
        {"bufferView": 0, "componentType": _FLOAT, "count": len(vertices), "type": "VEC3", "min": low, "max": high},
        {"bufferView": 1, "componentType": _UINT16, "normalized": True, "count": len(vertices), "type": "VEC4"},
        {"bufferView": 2, "componentType": _UINT32, "count": faces.size, "type": "SCALAR"},
    ]
    primitive = {"attributes": {"POSITION": 0, "COLOR_0": 1}, "indices": 2, "material": 0, "extras": {"below": below}}
    return packed(
        {
            "asset": {"version": "2.0"},
            "extensionsUsed": ["KHR_materials_unlit"],
            "scene": 0,
            "scenes": [{"nodes": [0], "extras": {"box": box}}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [primitive]}],
            "materials": [{"extensions": {"KHR_materials_unlit": {}}}],
            "buffers": [{"byteLength": offsets[-1]}],
            "bufferViews": views,
            "accessors": accessors,
        },
        b"".join(parts),
    )


def box_of(glb: bytes) -> tuple[Corner, Corner] | None:
    """Lower and upper corner [m] of the place whose surface this is, where it was told."""
    box = parts(glb)[0]["scenes"][0]["extras"]["box"]
    return None if box is None else (box[0], box[1])


def dressed(glb: bytes, opacity: float, clip: float) -> bytes:
    """A surface from `unlit_glb`, less opaque (0 to 1), and without what is above a share `clip` of its height."""
    document, binary = parts(glb)
    (primitive,) = document["meshes"][0]["primitives"]
    indices = document["accessors"][primitive["indices"]]
    # the faces stand in the order of their heights: what is cut off are the last ones
    indices["count"] = max(3, 3 * primitive["extras"]["below"][round(_CUTS * clip)])
    if opacity < 1:
        document["materials"][0] |= {
            "alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, opacity]}
        }  # fmt: skip
    return packed(document, binary)


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

    assert isinstance(mesh.visual, ColorVisuals), "only vertex colours are shown as they are"
    return np.asarray(mesh.visual.vertex_colors)[:, :3]

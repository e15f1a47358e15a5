"""glTF as it stands in its scene: the geometry of files that are built here, byte by byte, and what is wrong in it."""

import io
import json
import math
import struct
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pytest
from PIL import Image

from nerfnav.importers.core.errors import MeshFileError
from nerfnav.importers.meshes.files import MeshFile, read_mesh
from nerfnav.importers.meshes.parts import Parts, join_parts
from tests.importers.meshes.places import data_uri

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
TYPES = {"int8": 5120, "uint8": 5121, "int16": 5122, "uint16": 5123, "uint32": 5125, "float32": 5126}
SHAPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


class Builder:
    """A glTF in the making: arrays become accessors, each in a buffer view of its own."""

    def __init__(self) -> None:
        self.binary = b""
        self.header: dict[str, Any] = {
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": []}], "accessors": [], "bufferViews": [], "buffers": [],
        }  # fmt: skip

    def array(self, values: Any, kind: str = "float32", stride: int = 0, **more: Any) -> int:
        """The accessor of an array (n, k), or of numbers (n)."""
        rows = np.asarray(values, kind)
        rows = rows.reshape(len(rows), -1)
        data = rows.tobytes()
        if stride:
            data = b"".join(row.tobytes().ljust(stride, b"\xee") for row in rows)
        accessor = {"bufferView": self.view(data, **({"byteStride": stride} if stride else {}))}
        accessor |= {"componentType": TYPES[kind], "count": len(rows), "type": SHAPES[rows.shape[1]]} | more
        self.header["accessors"].append(accessor)
        return len(self.header["accessors"]) - 1

    def view(self, data: bytes, **more: Any) -> int:
        self.header["bufferViews"].append({"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data)} | more)
        self.binary += data + bytes(-len(data) % 4)
        return len(self.header["bufferViews"]) - 1

    def square(self, **more: Any) -> dict[str, Any]:
        """The square as a primitive of the first mesh, as a fan without indices."""
        primitive = {"attributes": {"POSITION": self.array(SQUARE)}, "mode": 6} | more
        self.header["meshes"][0]["primitives"].append(primitive)
        return primitive

    def write(self, path: Path) -> Path:
        self.header["buffers"] = self.header["buffers"] or [{"byteLength": len(self.binary)}]
        text = json.dumps(self.header).encode()
        text += b" " * (-len(text) % 4)
        body = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(self.binary), b"BIN\0")
        path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(body) + len(self.binary)) + body + self.binary)
        return path


@pytest.fixture
def gltf(tmp_path: Path) -> Builder:
    return Builder()


def read(gltf: Builder, folder: Path) -> tuple[Parts, MeshFile]:
    file = read_mesh(gltf.write(folder / "a.glb"))
    return join_parts(file.parts, file.path), file


def area_and_bounds(gltf: Builder, folder: Path) -> tuple[float, list[list[float]]]:
    parts, _ = read(gltf, folder)
    return float(parts.areas.sum()), parts.bounds.round(4).tolist()


def normals(parts: Parts) -> np.ndarray:
    corners = parts.vertices[parts.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return normal / np.linalg.norm(normal, axis=1, keepdims=True)


@pytest.mark.parametrize(
    ("mode", "order", "kind"),
    [
        (4, [0, 1, 2, 0, 2, 3], "uint8"),
        (4, [0, 1, 2, 0, 2, 3], "uint32"),
        (5, [0, 1, 3, 2], "uint16"),
        (6, [0, 1, 2, 3], "uint16"),
        (4, None, ""),
    ],
)
def test_lists_strips_and_fans_give_the_square_and_its_direction(
    gltf: Builder, tmp_path: Path, mode: int, order: list[int] | None, kind: str
):
    primitive = gltf.square(mode=mode)
    if order is None:
        primitive["attributes"]["POSITION"] = gltf.array(SQUARE[[0, 1, 2, 0, 2, 3]])
    else:
        primitive["indices"] = gltf.array(order, kind)
    assert area_and_bounds(gltf, tmp_path) == (1.0, [[0, 0, 0], [1, 1, 0]])
    np.testing.assert_allclose(normals(read(gltf, tmp_path)[0]), [[0, 0, 1]] * 2)


def test_points_and_lines_are_left_out_and_said(gltf: Builder, tmp_path: Path):
    gltf.square()
    gltf.square(mode=1)
    parts, file = read(gltf, tmp_path)
    assert len(parts.faces) == 2
    assert file.notes == ("its points and lines are left out: they are no surfaces",)


def test_instances_stand_at_their_translations_rotations_and_scales(gltf: Builder, tmp_path: Path):
    gltf.square()
    half = round(32767 * math.sqrt(0.5))
    attributes = {
        "TRANSLATION": gltf.array([[0, 0, 0], [5, 0, 0]]),
        "ROTATION": gltf.array([[0, 0, 0, 32767], [half, 0, 0, half]], "int16", normalized=True),
        "SCALE": gltf.array([[1, 1, 1], [2, 2, 2]]),
    }
    gltf.header["nodes"][0] |= {"extensions": {"EXT_mesh_gpu_instancing": {"attributes": attributes}}}
    gltf.header["nodes"][0]["translation"] = [0, 0, 10]
    area, bounds = area_and_bounds(gltf, tmp_path)
    assert area == pytest.approx(5.0, abs=1e-3)
    np.testing.assert_allclose(bounds, [[0, 0, 10], [7, 1, 12]], atol=1e-3)


def test_instances_of_several_counts_are_refused(gltf: Builder, tmp_path: Path):
    gltf.square()
    attributes = {"TRANSLATION": gltf.array(np.zeros((2, 3))), "SCALE": gltf.array(np.ones((3, 3)))}
    gltf.header["nodes"][0] |= {"extensions": {"EXT_mesh_gpu_instancing": {"attributes": attributes}}}
    with pytest.raises(MeshFileError, match=r"has \[2, 3\] instances, in place of one number"):
        read(gltf, tmp_path)


@pytest.mark.parametrize("has_view", [True, False])
def test_sparse_accessors_replace_single_elements(gltf: Builder, tmp_path: Path, has_view: bool):
    primitive = gltf.square()
    accessor = gltf.header["accessors"][primitive["attributes"]["POSITION"]]
    moved = [3] if has_view else [1, 2, 3]
    rows = SQUARE[moved] * (1, 4, 1)
    accessor["sparse"] = {
        "count": len(moved),
        "indices": {"bufferView": gltf.view(bytes(moved)), "componentType": 5121},
        "values": {"bufferView": gltf.view(rows.astype("<f4").tobytes())},
    }
    if not has_view:
        del accessor["bufferView"]
    assert area_and_bounds(gltf, tmp_path) == (2.5 if has_view else 4.0, [[0, 0, 0], [1, 4, 0]])


@pytest.mark.parametrize(
    ("kind", "unit", "normalized", "expected"),
    [("int16", 32767, True, 1.0), ("uint8", 255, True, 1.0), ("int8", 100, False, 100.0), ("uint16", 300, False, 300)],
)
def test_quantised_positions_with_strides_have_their_size(
    gltf: Builder, tmp_path: Path, kind: str, unit: int, normalized: bool, expected: float
):
    primitive = gltf.square()
    primitive["attributes"]["POSITION"] = gltf.array(SQUARE * unit, kind, stride=12, normalized=normalized)
    gltf.header["extensionsUsed"] = gltf.header["extensionsRequired"] = ["KHR_mesh_quantization"]
    assert area_and_bounds(gltf, tmp_path)[1] == [[0, 0, 0], [expected, expected, 0]]


@pytest.mark.parametrize(("mesh", "node", "height"), [([1.0], None, 3.0), ([1.0], [0.5], 2.0), (None, [2.0], 5.0)])
def test_morphs_stand_by_the_weights_of_the_node_else_of_the_mesh(
    gltf: Builder, tmp_path: Path, mesh: list[float] | None, node: list[float] | None, height: float
):
    lift = np.array([[0, 0, 0], [0, 0, 0], [0, 2, 0], [0, 2, 0]], np.float32)
    gltf.square(targets=[{"POSITION": gltf.array(lift)}])
    gltf.header["meshes"][0] |= {} if mesh is None else {"weights": mesh}
    gltf.header["nodes"][0] |= {} if node is None else {"weights": node}
    assert area_and_bounds(gltf, tmp_path) == (height, [[0, 0, 0], [1, height, 0]])


@pytest.mark.parametrize("normalized", [True, False])
def test_quantised_texture_coordinates_are_transformed(gltf: Builder, tmp_path: Path, normalized: bool):
    file = io.BytesIO()
    Image.new("RGB", (2, 2), (9, 8, 7)).save(file, "PNG")
    full = 65535 if normalized else 1000
    corners = gltf.array(np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * full, "uint16", normalized=normalized)
    scale = 0.5 if normalized else 0.0005
    info = {"index": 0, "extensions": {"KHR_texture_transform": {"scale": [scale, scale], "offset": [0.25, 0]}}}
    gltf.square(material=0)["attributes"]["TEXCOORD_0"] = corners
    gltf.header["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": info}}]
    gltf.header["textures"], gltf.header["images"] = [{"source": 0}], [{"uri": data_uri(file.getvalue())}]
    parts, _ = read(gltf, tmp_path)
    found = {tuple(row) for row in parts.paint.uv.reshape(-1, 2).round(3).tolist()}
    assert found == {(0.25, 1.0), (0.75, 1.0), (0.75, 0.5), (0.25, 0.5)}
    assert parts.paint.images[0][0, 0].tolist() == [9, 8, 7]


def test_a_skin_stands_where_its_joints_are_and_not_where_its_node_is(gltf: Builder, tmp_path: Path):
    primitive = gltf.square()
    primitive["attributes"]["JOINTS_0"] = gltf.array([[0, 1, 0, 0]] * 4, "uint8")
    weights = [[255, 0, 0, 0]] * 2 + [[0, 255, 0, 0]] * 2
    primitive["attributes"]["WEIGHTS_0"] = gltf.array(weights, "uint8", normalized=True)
    inverse = np.tile(np.eye(4), (2, 1, 1))
    inverse[1, 1, 3] = -1  # the second joint was bound at y = 1
    skin = {"joints": [1, 2], "inverseBindMatrices": gltf.array(inverse.swapaxes(1, 2).reshape(2, 16))}
    gltf.header["skins"] = [skin]
    gltf.header["scenes"] = [{"nodes": [0, 1]}]
    gltf.header["nodes"] = [
        {"mesh": 0, "skin": 0, "translation": [100, 0, 0]},
        {"children": [2]},
        {"translation": [0, 3, 0]},
    ]
    assert area_and_bounds(gltf, tmp_path) == (3.0, [[0, 0, 0], [1, 3, 0]])


def test_hidden_nodes_hide_those_below_them(gltf: Builder, tmp_path: Path):
    gltf.square()
    hidden = {"extensions": {"KHR_node_visibility": {"visible": False}}}
    gltf.header["scenes"] = [{"nodes": [0, 1]}]
    gltf.header["nodes"] = [{"mesh": 0}, {"children": [2], **hidden}, {"mesh": 0, "translation": [9, 0, 0]}]
    assert area_and_bounds(gltf, tmp_path) == (1.0, [[0, 0, 0], [1, 1, 0]])
    hidden["extensions"]["KHR_node_visibility"]["visible"] = True
    assert area_and_bounds(gltf, tmp_path)[0] == 2.0


def test_a_negative_scale_keeps_the_faces_outwards(gltf: Builder, tmp_path: Path):
    gltf.square()
    gltf.header["nodes"][0]["scale"] = [-1, 1, 1]
    np.testing.assert_allclose(normals(read(gltf, tmp_path)[0]), [[0, 0, 1]] * 2)


def test_a_matrix_is_column_major_and_children_stand_in_their_parents(gltf: Builder, tmp_path: Path):
    gltf.square()
    matrix = np.diag([2.0, 2.0, 2.0, 1.0])
    matrix[:3, 3] = 1, 2, 3
    parent = {"matrix": matrix.T.reshape(-1).tolist(), "children": [1]}
    gltf.header["nodes"] = [parent, {"mesh": 0, "translation": [1, 0, 0]}]
    assert area_and_bounds(gltf, tmp_path) == (4.0, [[3, 2, 3], [5, 4, 3]])


def test_the_chosen_scene_stands_and_its_cameras_and_lights_do_not_count(gltf: Builder, tmp_path: Path):
    gltf.square()
    gltf.header["nodes"] += [{"camera": 0}, {"extensions": {"KHR_lights_punctual": {"light": 0}}}]
    gltf.header["scenes"] = [{"nodes": []}, {"nodes": [0, 1, 2]}]
    gltf.header["scene"] = 1
    assert len(read(gltf, tmp_path)[0].faces) == 2
    del gltf.header["scene"]
    with pytest.raises(MeshFileError, match="holds no faces"):
        read(gltf, tmp_path)
    del gltf.header["scenes"]
    with pytest.raises(MeshFileError, match="has no scene"):
        read(gltf, tmp_path)


@pytest.mark.parametrize("name", ["a b.bin", "tür.bin", r"sub\a.bin", "sub/a.bin", "A.BIN"])
def test_buffers_are_found_by_percent_encoded_names_and_with_backslashes(gltf: Builder, tmp_path: Path, name: str):
    gltf.square()
    binary = tmp_path / name.replace("\\", "/")
    binary.parent.mkdir(exist_ok=True)
    binary.write_bytes(gltf.binary)
    for uri in (name, quote(name), name.upper()):
        gltf.header["buffers"] = [{"byteLength": len(gltf.binary), "uri": uri}]
        path = tmp_path / "a.gltf"
        path.write_text(json.dumps(gltf.header), encoding="utf-8-sig")
        if uri == name.upper() and ("/" in name or "\\" in name):
            continue  # folders count as they are written
        assert len(read_mesh(path).parts[0].faces) == 2


def test_a_data_uri_may_be_plain_or_base64(gltf: Builder, tmp_path: Path):
    gltf.square()
    plain = "data:application/octet-stream," + "".join(f"%{byte:02x}" for byte in gltf.binary)
    for uri in (plain, data_uri(gltf.binary)):
        (tmp_path / "a.gltf").write_text(json.dumps(gltf.header | {"buffers": [{"byteLength": 48, "uri": uri}]}))
        assert len(read_mesh(tmp_path / "a.gltf").parts[0].faces) == 2


def leaves(content: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Paths of all values in JSON."""
    items = content.items() if isinstance(content, dict) else enumerate(content) if isinstance(content, list) else ()
    return [path, *(leaf for key, value in items for leaf in leaves(value, (*path, key)))] if path else [
        leaf for key, value in items for leaf in leaves(value, (key,))
    ]  # fmt: skip


@pytest.mark.parametrize("value", [None, -1, 7, 10**30, 2.5, "x", [], {}, [None], True, float("nan")])
def test_no_value_anywhere_in_a_header_ends_in_anything_but_a_mesh_or_a_sentence(
    gltf: Builder, tmp_path: Path, value: Any
):
    gltf.square(indices=gltf.array([0, 1, 2, 3], "uint8"), material=0)
    gltf.header["nodes"][0] |= {"children": [1], "rotation": [0, 0, 0, 1]}
    gltf.header["nodes"].append({"matrix": np.eye(4).reshape(-1).tolist()})
    info = {"index": 0, "extensions": {"KHR_texture_transform": {"scale": [2, 2]}}}
    gltf.header["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": info}}]
    gltf.header["textures"], gltf.header["images"] = [{"source": 0}], [{"uri": "missing.png"}]
    whole = json.dumps(gltf.header)
    for path in leaves(gltf.header):
        gltf.header = json.loads(whole)
        place = gltf.header
        for key in path[:-1]:
            place = place[key]
        place[path[-1]] = value
        try:
            read(gltf, tmp_path)
        except MeshFileError as error:
            assert "\n" not in str(error) and str(tmp_path / "a.glb") in str(error)
            assert "cannot be read as" not in str(error), (path, error.__cause__)  # none comes from within a library


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda h: h.update(asset=2.0), r"at asset: expected object, got float"),
        (lambda h: h["bufferViews"][0].update(buffer=7), r"bufferViews\[0\] names buffers\[7\], and there are 1"),
        (lambda h: h["accessors"][0].update(count="4"), r"at accessors\[0\]\.count: expected int, got str"),
        (lambda h: h["accessors"][0].update(type="VEC2"), r"accessors\[0\] of type VEC2, where .*POSITION needs VEC3"),
        (lambda h: h["accessors"][0].update(count=5), r"accessors\[0\] needs 60 bytes 12 apart, and .* has 48"),
        (lambda h: h["nodes"][0].update(mesh=3), r"nodes\[0\] names meshes\[3\], and there are 1"),
        (lambda h: h["nodes"][0].update(children=[0]), "are their own ancestors"),
        (lambda h: h["meshes"][0]["primitives"][0].update(mode=4), "has 4 corners, no multiple of 3"),
        (lambda h: h.update(scene=2), r"scene names scenes\[2\], and there are 1"),
        (lambda h: h["accessors"][0].update(extensions={"ACME_packed": {}}), "without ACME_packed, which nerfnav"),
        (lambda h: h["meshes"][0]["primitives"][0].update(extensions={"ACME_x": 1}), "without ACME_x, which nerfnav"),
        (lambda h: h.update(extensionsUsed=["ACME_instancing"]), "without ACME_instancing, which nerfnav"),
    ],
)
def test_what_is_wrong_in_a_header_is_named_with_its_path(gltf: Builder, tmp_path: Path, change: Any, sentence: str):
    gltf.square()
    change(gltf.header)
    with pytest.raises(MeshFileError, match=sentence):
        read(gltf, tmp_path)


def test_extensions_that_do_not_shape_anything_are_named_once(gltf: Builder, tmp_path: Path):
    gltf.square()
    gltf.header["nodes"].append({"extensions": {"ACME_sound": {}}})
    gltf.header["extensionsUsed"] = ["ACME_sound", "KHR_lights_punctual", "KHR_node_visibility"]
    _, file = read(gltf, tmp_path)
    assert file.notes == ("the extensions ACME_sound are not known, and ignored",)

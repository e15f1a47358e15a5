"""glTF that requires extensions: how surfaces shine is ignored, what moves geometry or textures is applied."""

import json
import math
import struct
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import meshopt
import numpy as np
import pytest
import trimesh
from PIL import Image

from nerfnav.core.glb import parts
from nerfnav.importers.core.errors import MeshFileError
from tests.importers.meshes.places import color_at, data_uri, imported, quad, seen_from_above, two_textures, write

QUARTERS = {(0, 0): (200, 30, 10), (1, 0): (20, 180, 40), (0, 1): (30, 40, 190), (1, 1): (220, 210, 20)}
"""Colours of a picture's quarters: column and row from its upper left."""


def floor_of_quarters(path: Path, change: Callable[[dict[str, Any]], object] = lambda header: None) -> Path:
    """A floor of 2 x 2 m with a picture of four quarters on it; `change` changes its header."""
    pixels = np.zeros((64, 64, 3), np.uint8)
    for (column, row), color in QUARTERS.items():
        pixels[32 * row : 32 * row + 32, 32 * column : 32 * column + 32] = color
    mesh = quad(-1, 1)
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=Image.fromarray(pixels))
    flat = (mesh.vertices - mesh.bounds[0]) / np.maximum(np.ptp(mesh.vertices, axis=0), 1e-9)
    ground = [axis for axis in range(3) if np.ptp(mesh.vertices[:, axis]) > 0]
    mesh.visual = trimesh.visual.TextureVisuals(flat[:, ground], material=material)
    write(trimesh.Scene(mesh), path)
    header = json.loads(path.read_text())
    header["asset"]["generator"] = "somebody else"
    change(header)
    path.write_text(json.dumps(header))
    return path


def corners(image: np.ndarray) -> dict[tuple[int, int], tuple[int, ...]]:
    """Colours in the middles of a floor's quarters, west to east and north to south."""
    return {(column, row): color_at(image, column - 0.5, 0.5 - row) for column in (0, 1) for row in (0, 1)}


def nearest(color: tuple[int, ...]) -> tuple[int, int]:
    """The quarter of the picture that has this colour."""
    return min(QUARTERS, key=lambda quarter: sum(abs(a - b) for a, b in zip(QUARTERS[quarter], color, strict=True)))


def shown(path: Path) -> dict[tuple[int, int], tuple[int, int]]:
    """Which quarter of the picture each quarter of the floor shows."""
    return {place: nearest(color) for place, color in corners(seen_from_above(path)).items()}


def transform(**reported: Any) -> Callable[[dict[str, Any]], None]:
    def change(header: dict[str, Any]) -> None:
        header["extensionsRequired"] = header["extensionsUsed"] = ["KHR_texture_transform"]
        info = header["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]
        info["extensions"] = {"KHR_texture_transform": reported}

    return change


def test_extensions_of_light_and_shine_are_ignored(tmp_path: Path):
    names = ["KHR_lights_punctual", "KHR_materials_clearcoat", "KHR_materials_transmission", "KHR_materials_unlit"]

    def change(header: dict[str, Any]) -> None:
        header["extensionsRequired"] = header["extensionsUsed"] = names
        header["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "sun"}]}}

    usual = shown(floor_of_quarters(tmp_path / "usual.gltf"))
    assert len(set(usual.values())) == 4
    assert shown(floor_of_quarters(tmp_path / "lit.gltf", change)) == usual


def test_texture_transforms_are_applied(tmp_path: Path):
    usual = shown(floor_of_quarters(tmp_path / "usual.gltf"))
    moved = shown(floor_of_quarters(tmp_path / "moved.gltf", transform(offset=[0.5, 0.0])))
    assert moved == {place: (1 - column, row) for place, (column, row) in usual.items()}
    one = floor_of_quarters(tmp_path / "one.gltf", transform(offset=[0.0, 0.5], scale=[0.5, 0.5]))
    assert set(shown(one).values()) == {(0, 1)}
    mirrored = floor_of_quarters(tmp_path / "mirrored.gltf", transform(offset=[0.0, 1.0], scale=[1.0, -1.0]))
    assert shown(mirrored) == {place: (column, 1 - row) for place, (column, row) in usual.items()}


def test_a_quarter_turn_with_half_the_scale_shows_the_lower_left_quarter_as_the_standard_says(tmp_path: Path):
    turned = transform(offset=[0.0, 1.0], rotation=math.pi / 2, scale=[0.5, 0.5])
    assert set(shown(floor_of_quarters(tmp_path / "turned.gltf", turned)).values()) == {(0, 1)}


def test_a_texture_may_use_the_second_set_of_coordinates(tmp_path: Path):
    usual = shown(floor_of_quarters(tmp_path / "usual.gltf"))

    def change(header: dict[str, Any]) -> None:
        attributes = header["meshes"][0]["primitives"][0]["attributes"]
        attributes["TEXCOORD_1"] = attributes["TEXCOORD_0"]
        header["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"] = 1
        count = header["accessors"][attributes["TEXCOORD_1"]]["count"]
        header["buffers"].append({"byteLength": 8 * count, "uri": data_uri(bytes(8 * count))})
        header["bufferViews"].append({"buffer": len(header["buffers"]) - 1, "byteLength": 8 * count})
        view = len(header["bufferViews"]) - 1
        header["accessors"].append({"bufferView": view, "componentType": 5126, "count": count, "type": "VEC2"})
        attributes["TEXCOORD_0"] = len(header["accessors"]) - 1

    assert shown(floor_of_quarters(tmp_path / "second.gltf", change)) == usual


def compressed(path: Path) -> Path:
    """A .glb like that of `two_textures`, all geometry compressed by meshopt alone."""
    header, binary = parts(two_textures().export(file_type="glb"))
    header["extensionsRequired"] = header["extensionsUsed"] = ["EXT_meshopt_compression"]
    packed, places = bytearray(), 0
    for index, view in enumerate(header["bufferViews"]):
        start = view.get("byteOffset", 0)
        data = binary[start : start + view["byteLength"]]
        used = [entry for entry in header["accessors"] if entry.get("bufferView") == index]
        if not used:  # a picture
            view |= {"buffer": 0, "byteOffset": len(packed)}
            packed += data + bytes(-len(data) % 4)
            continue
        kind, size = (np.uint32, 4) if used[0]["type"] == "SCALAR" else (np.float32, 4 * int(used[0]["type"][-1]))
        rows = np.frombuffer(data, kind).reshape(-1, size // 4)
        mode = "TRIANGLES" if kind is np.uint32 else "ATTRIBUTES"
        stored = meshopt.encode_gltf_buffer(rows.reshape(-1) if kind is np.uint32 else rows, mode)
        reported = {"buffer": 0, "byteOffset": len(packed), "byteLength": len(stored), "byteStride": size}
        reported |= {"mode": mode, "count": len(rows)}
        view |= {"buffer": 1, "byteOffset": places, "extensions": {"EXT_meshopt_compression": reported}}
        packed += stored + bytes(-len(stored) % 4)
        places += view["byteLength"]
    fallback = {"byteLength": places, "extensions": {"EXT_meshopt_compression": {"fallback": True}}}
    header["buffers"] = [{"byteLength": len(packed)}, fallback]
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<II", len(text), 0x4E4F534A) + text
    body += struct.pack("<II", len(packed), 0x004E4942) + bytes(packed)
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body)
    return path


def test_meshopt_compression_is_decoded(tmp_path: Path):
    usual = seen_from_above(write(two_textures(), tmp_path / "usual.glb"))
    image = seen_from_above(compressed(tmp_path / "packed.glb"))
    np.testing.assert_array_equal(image, usual)


def test_meshopt_that_is_damaged_or_not_installed_is_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    path = compressed(tmp_path / "packed.glb")
    whole = path.read_bytes()
    header, binary = parts(whole)
    entries = (view["extensions"] for view in header["bufferViews"] if "extensions" in view)
    packing = next(entries)["EXT_meshopt_compression"]
    at = whole.index(binary) + packing["byteOffset"]
    path.write_bytes(whole[:at] + bytes(8) + whole[at + 8 :])
    with pytest.raises(MeshFileError, match="damaged"):
        imported(path)
    path.write_bytes(whole)
    monkeypatch.setitem(sys.modules, "meshopt", None)
    with pytest.raises(MeshFileError, match=r"pip install 'nerfnav\[meshopt\]'"):
        imported(path)


def test_ktx2_textures_give_way_to_ordinary_ones_or_are_reported(tmp_path: Path):
    def beside(header: dict[str, Any]) -> None:
        header["extensionsUsed"] = ["KHR_texture_basisu"]
        header["images"].append({"uri": data_uri(b"\xabKTX 20\xbb\r\n\x1a\n"), "mimeType": "image/ktx2"})
        header["textures"][0]["extensions"] = {"KHR_texture_basisu": {"source": len(header["images"]) - 1}}

    def alone(header: dict[str, Any]) -> None:
        beside(header)
        header["extensionsRequired"] = ["KHR_texture_basisu"]
        del header["textures"][0]["source"]

    assert len(set(shown(floor_of_quarters(tmp_path / "beside.gltf", beside)).values())) == 4
    guesses, image = reported_of(floor_of_quarters(tmp_path / "alone.gltf", alone))
    assert sum("(a KTX2 texture), so what it covers is grey" in guess for guess in guesses) == 1
    assert set(image.tolist()) == {-1}


def reported_of(path: Path) -> tuple[list[str], np.ndarray]:
    """The guesses of an imported mesh, and which image each face has."""
    found = imported(path)
    guesses = found.report["guesses"]
    assert isinstance(guesses, list) and found.scene.paint is not None
    return guesses, found.scene.paint.image_of_face


@pytest.mark.parametrize("suffix", [".gltf", ".obj"])
def test_a_missing_texture_makes_what_it_covers_grey_and_says_so(tmp_path: Path, suffix: str):
    path = write(two_textures(pbr=suffix != ".obj"), tmp_path / f"two{suffix}")
    if suffix == ".gltf":
        header = json.loads(path.read_text())
        header["images"][0] = {"uri": "red.png"}
        path.write_text(json.dumps(header))
    else:
        next(iter(sorted(tmp_path.glob("*.png")))).unlink()
    guesses, image = reported_of(path)
    assert sum("is missing, so what it covers is grey" in guess for guess in guesses) == 1
    assert set(image.tolist()) == {-1, 0}

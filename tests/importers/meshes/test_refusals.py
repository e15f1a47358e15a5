"""What is no mesh that can be worked with, each reported in one sentence."""

import json
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh

from nerfnav.importers.core.errors import MeshFileError
from nerfnav.importers.meshes.files import SUFFIXES, read_mesh
from tests.importers.meshes.places import data_uri, imported, quad, textured, two_textures, write, write_collada


def _file(folder: Path, suffix: str) -> Path:
    path = folder / f"box{suffix}"
    box = trimesh.creation.box((1, 1, 1))
    return write_collada([(box, (9, 9, 9))], path) if suffix == ".dae" else write(trimesh.Scene(box), path)


def _refused(path: Path, match: str) -> None:
    with pytest.raises(MeshFileError, match=match) as caught:
        imported(path)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_an_empty_file_is_refused(tmp_path: Path, suffix: str):
    path = tmp_path / f"nothing{suffix}"
    path.touch()
    _refused(path, "is empty")


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_text_under_the_name_of_a_mesh_is_refused(tmp_path: Path, suffix: str):
    path = tmp_path / f"letter{suffix}"
    path.write_text("Dear reader,\nvery little of this is a mesh.\n" * 20)
    _refused(path, "is not")


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("share", [0.05, 0.5, 0.9])
def test_a_file_that_was_cut_off_is_refused(tmp_path: Path, suffix: str, share: float):
    path = _file(tmp_path, suffix)
    data = path.read_bytes()
    if suffix == ".obj":  # any beginning of a list of lines is one: but its faces name vertices, which come first
        data = b"\n".join(sorted(data.splitlines(), key=lambda line: line.startswith(b"v ")))
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(MeshFileError):
        imported(path)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_one_format_under_the_name_of_another_is_refused(tmp_path: Path, suffix: str):
    for other in set(SUFFIXES) - {suffix}:
        path = tmp_path / f"wrong{suffix}"
        path.write_bytes(_file(tmp_path, other).read_bytes())
        with pytest.raises(MeshFileError):
            imported(path)


def test_points_without_faces_are_refused(tmp_path: Path):
    path = tmp_path / "cloud.ply"
    path.write_bytes(trimesh.PointCloud(np.eye(3)).export(file_type="ply"))
    _refused(path, "holds no faces")
    path = tmp_path / "cloud.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n")
    _refused(path, "holds no faces")


def test_faces_without_area_are_refused(tmp_path: Path):
    path = tmp_path / "line.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n")
    _refused(path, "no face with any area")


@pytest.mark.parametrize("number", [np.nan, np.inf])
def test_vertices_that_are_no_numbers_are_refused(tmp_path: Path, number: float):
    box = trimesh.creation.box((1, 1, 1))
    data = bytearray(box.export(file_type="stl"))
    data[84 + 12 : 84 + 16] = struct.pack("<f", number)
    path = tmp_path / "box.stl"
    path.write_bytes(bytes(data))
    _refused(path, "1 vertices with coordinates that are no finite numbers")


def test_a_face_with_a_corner_that_does_not_exist_is_refused(tmp_path: Path):
    path = tmp_path / "broken.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 30\n")
    with pytest.raises(MeshFileError):
        imported(path)


def test_a_missing_buffer_is_named(tmp_path: Path):
    path = write(two_textures(), tmp_path / "two.gltf")
    header = json.loads(path.read_text())
    buffer = tmp_path / header["buffers"][0]["uri"]
    data = buffer.read_bytes()
    buffer.unlink()
    _refused(path, f"needs the file {buffer.name}, which is not beside it")
    buffer.write_bytes(data[:-100])
    _refused(path, "cut off")


def _made_grey(path: Path, match: str) -> None:
    """Assert that a texture that cannot be read makes grey, and one note."""
    found = imported(path)
    guesses = found.report["guesses"]
    assert isinstance(guesses, list) and sum(match in guess for guess in guesses) == 1
    assert found.scene.paint is not None and -1 in found.scene.paint.image_of_face


def test_a_texture_that_is_no_picture_makes_grey(tmp_path: Path):
    path = write_collada([(quad(-1, 1), (9, 9, 9))], tmp_path / "floor.dae")
    (tmp_path / "floor0.png").write_text("no picture")
    _made_grey(path, "its texture floor0.png is no picture that can be read (text), so what it covers is grey")
    path = write(textured(quad(-1, 1), (9, 9, 9)), tmp_path / "floor.glb")
    path.write_bytes(path.read_bytes().replace(b"\x89PNG", b"\x00ING"))
    _made_grey(path, "its texture images[0] is no picture")


def test_a_texture_inside_a_gltf_that_is_no_picture_makes_grey(tmp_path: Path):
    path = write(two_textures(), tmp_path / "two.gltf")
    header = json.loads(path.read_text())
    header["images"][0] = {"uri": data_uri(b"no picture"), "mimeType": "image/png"}
    path.write_text(json.dumps(header))
    _made_grey(path, "its texture images[0] is no picture")
    header["images"][0] = {"bufferView": 9999}
    path.write_text(json.dumps(header))
    _refused(path, r"images\[0\] names bufferViews\[9999\]")


@pytest.mark.parametrize(
    "uri", ["../secret.bin", "%2e%2e/secret.bin", "/etc/passwd", "file:///etc/passwd", "a/../../s"]
)
def test_nothing_outside_the_folder_of_a_mesh_is_read(tmp_path: Path, uri: str, monkeypatch: pytest.MonkeyPatch):
    folder = tmp_path / "inner"
    folder.mkdir()
    (tmp_path / "secret.bin").write_bytes(b"secret" * 1000)
    path = write(two_textures(), folder / "two.gltf")
    header = json.loads(path.read_text())
    header["buffers"][0]["uri"] = uri
    path.write_text(json.dumps(header))
    read = Path.read_bytes
    seen: list[Path] = []
    monkeypatch.setattr(Path, "read_bytes", lambda self: seen.append(self.resolve()) or read(self))
    _refused(path, "outside its own folder")
    assert all(file.is_relative_to(folder) for file in seen)


def test_a_link_that_leads_out_of_the_folder_is_not_followed(tmp_path: Path):
    folder = tmp_path / "inner"
    folder.mkdir()
    path = write(two_textures(), folder / "two.gltf")
    buffer = folder / json.loads(path.read_text())["buffers"][0]["uri"]
    buffer.rename(tmp_path / "elsewhere.bin")
    buffer.symlink_to(tmp_path / "elsewhere.bin")
    _refused(path, "outside its own folder")


def test_damaged_draco_compression_is_not_taken_for_a_point(tmp_path: Path):
    path = tmp_path / "draco.glb"
    scene = trimesh.Scene([trimesh.creation.box((1, 1, 1)), trimesh.creation.icosphere()])
    data = bytearray(scene.export(file_type="glb", extension_draco=True))
    start = data.index(b"DRACO")
    data[start + 12 : start + 60] = bytes(48)
    path.write_bytes(bytes(data))
    with pytest.raises(MeshFileError):
        imported(path)


def test_an_extension_that_is_not_understood_is_named(tmp_path: Path):
    path = write(two_textures(), tmp_path / "two.gltf")
    header = json.loads(path.read_text()) | {"extensionsRequired": ["VENDOR_secret_geometry"]}
    path.write_text(json.dumps(header))
    _refused(path, "VENDOR_secret_geometry, which nerfnav does not know: export it without")


def test_collada_with_entities_of_its_own_is_refused(tmp_path: Path):
    path = _file(tmp_path, ".dae")
    text = path.read_text().replace("<COLLADA", '<!DOCTYPE x [<!ENTITY e SYSTEM "file:///etc/passwd">]><COLLADA', 1)
    path.write_text(text)
    _refused(path, "entities of its own")


def test_a_file_of_another_kind_or_none_is_refused(tmp_path: Path):
    with pytest.raises(MeshFileError, match=r"these can: \.glb, \.gltf, \.obj, \.ply, \.stl, \.off, \.dae"):
        read_mesh(tmp_path / "a.fbx")
    with pytest.raises(MeshFileError, match="No such file"):
        read_mesh(tmp_path / "a.glb")

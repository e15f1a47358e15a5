"""Every format, its textures and colours, as they look in the end."""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from trimesh.visual.color import ColorVisuals
from trimesh.visual.texture import TextureVisuals

from tests.importers.meshes.places import (
    color_at,
    data_uri,
    imported,
    quad,
    seen_from_above,
    textured,
    two_textures,
    write,
    write_collada,
)

_RED, _GREEN, _BLACK = (200, 30, 10), (20, 180, 40), (0, 0, 0)


def _near(color: tuple[int, ...], expected: tuple[int, ...], tolerance: int = 1) -> bool:
    return all(abs(a - b) <= tolerance for a, b in zip(color, expected, strict=True))


@pytest.mark.parametrize("suffix", [".glb", ".gltf", ".obj"])
def test_parts_of_different_textures_keep_their_own_colours(tmp_path: Path, suffix: str):
    image = seen_from_above(write(two_textures(pbr=suffix != ".obj"), tmp_path / f"two{suffix}"))
    assert _near(color_at(image, -0.5, -0.5), _RED)
    assert _near(color_at(image, 0.5, -0.5), _GREEN)
    assert _near(color_at(image, -0.5, 0.5), _BLACK)
    assert _near(color_at(image, 0.5, 0.5), _BLACK)


def test_vertex_colours_of_a_ply_are_interpolated(tmp_path: Path):
    floor = quad(-1, 1)
    floor.visual = ColorVisuals(floor, vertex_colors=[[0, 0, 40], [200, 0, 40], [200, 100, 40], [0, 100, 40]])
    image = seen_from_above(write(floor, tmp_path / "floor.ply"))
    assert _near(color_at(image, 0.0, 0.0), (100, 50, 40), 3)
    assert _near(color_at(image, 0.9, -0.9), (190, 5, 40), 4)


def test_an_stl_has_shape_but_one_colour_with_light_on_it(tmp_path: Path):
    found = imported(write(trimesh.creation.box((1, 1, 1)), tmp_path / "box.stl"))
    assert len(found.scene.solids) == 1
    assert found.scene.paint is not None
    brightness = {tuple(corner) for corner in found.scene.paint.tint[:, 0].tolist()}
    assert len(brightness) == 3  # opposite faces are alike


def test_a_texture_that_repeats_does_so_within_its_own_part(tmp_path: Path):
    scene = two_textures()
    for mesh in scene.geometry.values():
        mesh.visual.uv = mesh.visual.uv * 3 + 1000
    image = seen_from_above(write(scene, tmp_path / "tiled.glb"))
    south_of_each = [-1 + 2 * (k + 0.25) / 3 for k in range(3)]
    assert all(_near(color_at(image, -0.5, y), _RED) and _near(color_at(image, 0.5, y), _GREEN) for y in south_of_each)


def test_parts_that_share_a_texture_share_one_copy_of_it(tmp_path: Path):
    part = textured(quad(-1, 0), _RED)
    scene = trimesh.Scene()
    for number in range(20):
        scene.add_geometry(part, transform=trimesh.transformations.translation_matrix([number, 0, 0]))
    found = imported(write(scene, tmp_path / "many.glb"))
    assert found.scene.paint is not None
    assert len(found.scene.paint.images) == 1
    assert found.report["faces"] == 40


def test_a_mirrored_part_keeps_its_faces_outwards(tmp_path: Path):
    scene = trimesh.Scene()
    scene.add_geometry(trimesh.creation.box((1, 1, 1)), transform=np.diag([-1.0, 1.0, 1.0, 1.0]))
    found = imported(write(scene, tmp_path / "mirrored.glb"))
    (solid,) = found.scene.solids
    assert solid.volume == pytest.approx(1.0)
    assert found.scene.mesh.volume == pytest.approx(1.0)


def test_colours_of_gltf_are_linear_light(tmp_path: Path):
    """A factor of 0.2140 is the sRGB value 127.5, by the standard and by every viewer of glTF."""
    path = write(textured(quad(-1, 1), (255, 255, 255)), tmp_path / "floor.gltf")
    header = json.loads(path.read_text())
    header["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = [0.2140, 1.0, 0.0, 1.0]
    header["asset"]["generator"] = "somebody else"
    path.write_text(json.dumps(header))
    assert _near(color_at(seen_from_above(path), 0.0, -0.5), (127, 255, 0))


def test_draco_compressed_gltf_is_decoded(tmp_path: Path):
    path = tmp_path / "draco.glb"
    path.write_bytes(trimesh.Scene([two_textures().geometry["west"]]).export(file_type="glb", extension_draco=True))
    assert b"KHR_draco_mesh_compression" in path.read_bytes()
    found = imported(path)
    assert np.allclose(sorted(np.ptp(found.scene.mesh.vertices, axis=0)), [0, 1, 2], atol=1e-3)


def test_a_gltf_may_hold_its_buffers_in_itself(tmp_path: Path):
    path = write(two_textures(), tmp_path / "two.gltf")
    header = json.loads(path.read_text())
    for buffer in header["buffers"]:
        buffer["uri"] = data_uri((tmp_path / buffer["uri"]).read_bytes())
    inside = tmp_path / "alone" / "inside.gltf"
    inside.parent.mkdir()
    inside.write_text(json.dumps(header))
    assert _near(color_at(seen_from_above(inside), 0.5, -0.5), _GREEN)


def test_an_obj_without_its_materials_is_grey_and_says_so(tmp_path: Path):
    path = write(two_textures(pbr=False), tmp_path / "two.obj")
    (tmp_path / "two.mtl").unlink()
    found = imported(path)
    assert found.scene.paint is not None
    assert (found.scene.paint.image_of_face == -1).all()
    assert len(set(found.scene.paint.tint[0, 0].tolist())) == 1
    guesses = found.report["guesses"]
    assert isinstance(guesses, list)
    assert any("two.mtl" in guess and "grey" in guess for guess in guesses)


def test_textures_of_collada_are_found_beside_its_file(tmp_path: Path):
    image = seen_from_above(write_collada([(quad(-1, 0), _RED), (quad(0, 1), _GREEN)], tmp_path / "two.dae"))
    assert _near(color_at(image, -0.5, 0.3), _RED)
    assert _near(color_at(image, 0.5, 0.3), _GREEN)


def test_plain_materials_get_light_and_textures_of_one_colour_do_not(tmp_path: Path):
    textured_part, plain_part = textured(quad(-1, 0), _RED), textured(quad(0, 1), _GREEN)
    textured_part.visual.material.baseColorTexture = Image.new("RGB", (2, 2), _RED)
    plain_part.visual.material.baseColorTexture = None
    plain_part.visual.material.baseColorFactor = [*_GREEN, 255]
    image = seen_from_above(write(trimesh.Scene([textured_part, plain_part]), tmp_path / "floor.glb"))
    assert color_at(image, -0.5, -0.5) == _RED
    assert _near(color_at(image, 0.5, -0.5), tuple(round(0.894 * x) for x in _GREEN))


def test_texture_coordinates_that_are_no_numbers_do_no_harm(tmp_path: Path):
    mesh = textured(quad(-1, 1), _RED)
    assert isinstance(mesh.visual, TextureVisuals)
    mesh.visual.uv = np.full((4, 2), np.nan)
    assert seen_from_above(write(mesh, tmp_path / "floor.glb")).shape == (40, 40, 3)

"""What of a mesh is solid, and what is only surface."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from nerfnav.importers.core.placement import Placement
from nerfnav.importers.meshes.config import MeshOptions, SceneConfig
from nerfnav.world.scene import Scene, Vantage
from tests.importers.meshes.places import imported, quad, write

_CONFIG = SceneConfig(Placement(up=(0, 0, 1), scale=1.0))


def _scene(tmp_path: Path, *meshes: trimesh.Trimesh, config: SceneConfig = _CONFIG) -> Scene:
    return imported(write(trimesh.Scene(list(meshes)), tmp_path / "place.glb"), config).scene


def _box(edge: float, x: float = 0.0) -> trimesh.Trimesh:
    return trimesh.creation.box((edge, edge, edge)).apply_translation([x, 0, 0])


def _loose(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """The same faces, none of which share a vertex: as files with normals of their own for each face hold them."""
    return trimesh.Trimesh(mesh.triangles.reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3), process=False)


def test_boxes_of_loose_faces_are_solids(tmp_path: Path):
    scene = _scene(tmp_path, _loose(_box(1.0)), _loose(_box(1.0, 3.0)))
    assert [solid.volume for solid in scene.solids] == pytest.approx([1.0, 1.0])
    assert all(solid.is_watertight for solid in scene.solids)
    assert scene.sheets == ()


def test_a_solid_whose_sides_are_parts_of_their_own_is_one(tmp_path: Path):
    box = _box(1.0)
    top = box.face_normals[:, 2] > 0.5
    scene = _scene(tmp_path, box.submesh([top], append=True), box.submesh([~top], append=True))
    assert [solid.volume for solid in scene.solids] == pytest.approx([1.0])


def test_stacked_boxes_that_share_edges_stay_apart(tmp_path: Path):
    scene = _scene(tmp_path, _box(1.0), _box(1.0, 1.0))
    assert [solid.volume for solid in scene.solids] == pytest.approx([1.0, 1.0])


def test_a_small_box_inside_out_is_a_solid_again(tmp_path: Path):
    turned = _box(1.0)
    turned.invert()
    scene = _scene(tmp_path, turned, _box(1.0, 5.0), _box(1.0, 10.0))
    assert [solid.volume for solid in scene.solids] == pytest.approx([1.0, 1.0, 1.0])


@pytest.mark.parametrize("inwards", [False, True])
def test_a_box_around_everything_is_a_room_and_not_a_solid(tmp_path: Path, inwards: bool):
    room = trimesh.creation.box((8, 6, 3))
    if inwards:
        room.invert()
    scene = _scene(tmp_path, room, _box(1.0), _box(0.5, 2.0))
    assert len(scene.solids) == 2
    (sheet,) = scene.sheets
    assert sheet.area == pytest.approx(room.area)
    assert scene.vantage is Vantage.INSIDE


def test_an_empty_room_with_its_faces_inwards_is_a_room(tmp_path: Path):
    room = trimesh.creation.box((8, 6, 3))
    room.invert()
    assert _scene(tmp_path, room).solids == ()


def test_a_block_without_a_bottom_still_has_an_inside(tmp_path: Path):
    block = _box(1.0)
    block.update_faces(block.face_normals[:, 2] > -0.5)
    found = imported(write(trimesh.Scene(block), tmp_path / "block.glb"), _CONFIG)
    assert found.report["solids_not_watertight"] == 1
    assert found.scene.sheets == ()


def test_bumpy_ground_is_a_sheet_above_which_nothing_is_inside(tmp_path: Path):
    x, y = np.meshgrid(np.linspace(-5, 5, 30), np.linspace(-5, 5, 30))
    vertices = np.stack([x, y, 0.4 * np.sin(2 * x) * np.cos(2 * y)], -1).reshape(-1, 3)
    index = np.arange(900).reshape(30, 30)
    a, b, c, d = (part.reshape(-1) for part in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])
    scene = _scene(tmp_path, trimesh.Trimesh(vertices, faces, process=False))
    assert scene.solids == ()
    assert len(scene.sheets) == 1
    assert scene.vantage is Vantage.OUTSIDE


def test_a_plate_seen_from_both_sides_has_no_inside(tmp_path: Path):
    below = quad(-1, 1)
    below.invert()
    scene = _scene(tmp_path, trimesh.util.concatenate([quad(-1, 1), below]), _box(0.5, 3.0))
    assert len(scene.solids) == 1
    assert len(scene.sheets) == 1


def test_what_is_asked_for_decides_from_where_a_place_is_seen(tmp_path: Path):
    config = SceneConfig(Placement(up=(0, 0, 1), scale=1.0), MeshOptions(seen_from="inside"))
    assert _scene(tmp_path, _box(1.0), config=config).vantage is Vantage.INSIDE

"""Ground truth beside a field."""

import hashlib
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh

from nerfnav.core.errors import FieldFileError
from nerfnav.importers.meshes.ground_truth import load_truth, truth_path, write_truth_beside
from nerfnav.world.raycast import MeshRenderer
from nerfnav.world.scene import Scene
from tests.importers.meshes.places import ABOVE, CAMERA, UP_Z, imported, quad, two_textures, write


def _scene(folder: Path) -> Scene:
    place = two_textures()
    place.add_geometry(trimesh.creation.box((0.2, 0.2, 0.2)))
    place.add_geometry(trimesh.creation.box((0.1, 0.2, 0.3)), transform=np.diag([1.0, 1, 1, 1]))
    return imported(write(place, folder / "place.glb"), UP_Z).scene


def test_a_ground_truth_comes_back_as_it_was(tmp_path: Path):
    scene, field = _scene(tmp_path), tmp_path / "house.npz"
    with write_truth_beside(scene, field) as link:
        assert not truth_path(field).exists()  # before its field is
    assert truth_path(field) == tmp_path / link.name == tmp_path / "house.truth.npz"
    again = load_truth(tmp_path / link.name, link.sha256)
    assert (again.name, again.sky, again.voxel, again.vantage) == (scene.name, scene.sky, scene.voxel, scene.vantage)
    assert torch.equal(again.box.lower, scene.box.lower)
    for mine, theirs in zip((again.mesh, *again.solids, *again.sheets), (scene.mesh, *scene.solids, *scene.sheets),
                            strict=True):  # fmt: skip
        assert np.array_equal(mine.vertices, theirs.vertices)
        assert np.array_equal(mine.faces, theirs.faces)
    seen, before = (MeshRenderer(place).render(CAMERA, ABOVE).image for place in (again, scene))
    assert torch.equal(seen, before)


def test_a_place_of_sheets_alone_comes_back_too(tmp_path: Path):
    scene = imported(write(quad(-1, 1), tmp_path / "floor.ply")).scene
    assert scene.solids == ()
    with write_truth_beside(scene, tmp_path / "floor.npz") as link:
        pass
    again = load_truth(tmp_path / link.name, link.sha256)
    assert again.solids == ()
    assert len(again.sheets) == 1


def test_when_the_field_cannot_be_saved_the_old_ground_truth_stays(tmp_path: Path):
    scene, old = _scene(tmp_path), truth_path(tmp_path / "house.npz")
    old.write_text("old")
    before = set(tmp_path.iterdir())
    with pytest.raises(FieldFileError, match="disk full"), write_truth_beside(scene, tmp_path / "house.npz"):
        raise FieldFileError("disk full")
    assert old.read_text() == "old"
    assert set(tmp_path.iterdir()) == before


def test_a_folder_that_cannot_be_written_to_is_reported(tmp_path: Path):
    with (
        pytest.raises(FieldFileError, match="the ground truth cannot be written"),
        write_truth_beside(_scene(tmp_path), tmp_path / "missing" / "house.npz"),
    ):
        pass


def test_another_file_in_the_place_of_the_ground_truth_is_refused(tmp_path: Path):
    scene = _scene(tmp_path)
    with write_truth_beside(scene, tmp_path / "house.npz") as link:
        pass
    path = tmp_path / link.name
    path.write_bytes(path.read_bytes() + b"0")
    with pytest.raises(FieldFileError, match="not the ground truth that its field was trained from"):
        load_truth(path, link.sha256)
    path.write_text("no truth")
    with pytest.raises(FieldFileError, match="no whole ground truth"):
        load_truth(path, hashlib.sha256(b"no truth").hexdigest())
    with pytest.raises(FieldFileError, match="cannot be read"):
        load_truth(tmp_path / "gone.npz", link.sha256)

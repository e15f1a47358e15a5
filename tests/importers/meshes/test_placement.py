"""Which way is up and how long a unit is: reported, declared and guessed."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from nerfnav.core.errors import InvalidInputError
from nerfnav.importers.core.errors import MeshFileError
from nerfnav.importers.core.placement import MeasuredDistance, Placement
from nerfnav.importers.meshes.config import MeshOptions, SceneConfig
from nerfnav.importers.meshes.importer import ImportedMesh
from tests.importers.meshes.places import imported, quad, write, write_collada


def _hall(scale: float = 1.0, up: str = "z") -> trimesh.Scene:
    """A floor of 14 x 21 m with crates on it and one mast of 9 m: flat, and heavy below."""
    floor = trimesh.creation.box((14, 21, 0.1))
    crates = [trimesh.creation.box((1, 1, 1)).apply_translation([x, y, 0.5]) for x in (-4, 0, 4) for y in (-8, 0, 8)]
    mast = trimesh.creation.box((0.2, 0.2, 9)).apply_translation([0, 3, 4.5])
    scene = trimesh.Scene([floor, *crates, mast])
    if up == "y":
        scene.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, [1, 0, 0]))
    scene.apply_transform(np.diag([scale, scale, scale, 1]))
    return scene


def _size(found: ImportedMesh) -> list[float]:
    size = found.report["size_m"]
    assert isinstance(size, list)
    return size


def _guesses(found: ImportedMesh) -> str:
    guesses = found.report["guesses"]
    assert isinstance(guesses, list)
    return "; ".join(guesses)


def test_a_gltf_is_y_up_and_in_metres_as_its_standard_says(tmp_path: Path):
    found = imported(write(_hall(up="y"), tmp_path / "hall.glb"))
    assert _size(found) == pytest.approx([14, 21, 9.05], abs=1e-3)
    assert "up is y" in _guesses(found)
    assert "lengths are in m" in _guesses(found)


def test_a_gltf_that_was_written_z_up_is_found_out(tmp_path: Path):
    found = imported(write(_hall(up="z"), tmp_path / "hall.glb"))
    assert found.report["up"] == "z"
    assert _size(found) == pytest.approx([14, 21, 9.05], abs=1e-3)
    assert "up is z (guessed" in _guesses(found)


def test_a_tower_is_not_laid_down(tmp_path: Path):
    tower = trimesh.creation.box((6, 30, 6))
    assert imported(write(trimesh.Scene(tower), tmp_path / "tower.glb")).report["up"] == "y"


def test_what_is_asked_for_is_not_guessed(tmp_path: Path):
    path = write(_hall(), tmp_path / "hall.glb")
    config = SceneConfig(Placement(up=(0, 1, 0)), MeshOptions(units="cm", seen_from="outside"), voxel=0.01)
    found = imported(path, config)
    assert (found.report["up"], found.report["scale"]) == ("y", 0.01)
    assert _size(found) == pytest.approx([0.14, 0.0905, 0.21], abs=1e-4)
    assert found.report["guesses"] == []


@pytest.mark.parametrize(("suffix", "unit", "scale"), [(".stl", "mm", 1000.0), (".obj", "cm", 100.0)])
def test_a_unit_is_guessed_so_that_the_place_has_a_plausible_size(
    tmp_path: Path, suffix: str, unit: str, scale: float
):
    found = imported(write(_hall(scale).to_mesh(), tmp_path / f"hall{suffix}"))
    assert f"lengths are in {unit}" in _guesses(found)
    assert max(_size(found)) == pytest.approx(21, rel=1e-3)


def test_collada_says_itself_what_is_up_and_how_long_its_unit_is(tmp_path: Path):
    box = trimesh.creation.box((100, 200, 50))
    found = imported(write_collada([(box, (9, 9, 9))], tmp_path / "box.dae", up="Y", meter=0.0254))
    assert _size(found) == pytest.approx([2.54, 1.27, 5.08], abs=1e-3)
    assert "up is y (the file says so)" in _guesses(found)
    assert "lengths are in in (the file says so)" in _guesses(found)


def test_two_picked_points_give_the_scale_too(tmp_path: Path):
    path = write(quad(-1, 1), tmp_path / "floor.ply")
    picked = Placement(picked=MeasuredDistance((-1, 0, 0), (1, 0, 0), 5.0))
    assert max(_size(imported(path, SceneConfig(picked)))) == pytest.approx(5.0)


def test_any_direction_can_be_up(tmp_path: Path):
    rod = trimesh.creation.box((0.1, 0.1, 2.0))
    rod.apply_transform(trimesh.geometry.align_vectors([0, 0, 1], [1, 2, 2]))
    config = SceneConfig(Placement(up=(1, 2, 2), scale=1.0))
    assert _size(imported(write(rod, tmp_path / "rod.ply"), config))[2] == pytest.approx(2.0, rel=1e-3)


def test_a_mesh_far_from_its_origin_is_brought_there_and_reported(tmp_path: Path):
    hall = _hall().to_mesh().apply_translation([500_000, 4_000_000, 100])
    path = tmp_path / "utm.obj"
    path.write_text(hall.export(file_type="obj", digits=3))
    found = imported(path, SceneConfig(Placement(up=(0, 0, 1))))
    assert "moved by -500000.0, -4000000.0, -100.0 m" in _guesses(found)
    assert np.abs(found.scene.mesh.vertices).max() < 12


@pytest.mark.parametrize("scale", [1e9, 1e-9])
def test_absurd_sizes_are_refused_with_what_would_help(tmp_path: Path, scale: float):
    path = tmp_path / "big.ply"
    path.write_bytes(_hall(scale).to_mesh().export(file_type="ply"))
    with pytest.raises(MeshFileError, match=r"m long, but only .* --units or --scale"):
        imported(path)


def test_units_and_a_scale_together_are_refused():
    with pytest.raises(InvalidInputError, match="either units or a scale"):
        SceneConfig(Placement(scale=2.0), MeshOptions(units="m"))

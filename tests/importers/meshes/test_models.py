"""Gazebo's layout: meshes/ beside materials/textures/, found whether the folder or its mesh is named."""

import zipfile
from pathlib import Path, PurePosixPath

import pytest

from nerfnav.importers.core.errors import MeshFileError
from nerfnav.importers.meshes.files import find_mesh, list_archived_meshes, resolve_mesh, select_mesh
from tests.importers.meshes.places import color_at, imported, quad, seen_from_above, write_collada

_RED = (200, 30, 10)


def model(folder: Path, textures: str = "materials/textures") -> Path:
    """A model whose mesh names its texture by name alone, as Gazebo finds it."""
    (folder / "meshes").mkdir(parents=True)
    (folder / textures).mkdir(parents=True)
    (folder / "model.config").write_text("<model/>")
    mesh = write_collada([(quad(-1, 1), _RED)], folder / "meshes" / "floor.dae")
    (folder / "meshes" / "floor0.png").rename(folder / textures / "floor0.png")
    return mesh


@pytest.mark.parametrize("textures", ["materials/textures", "textures"])
def test_textures_are_found_beside_the_meshes_of_a_model(tmp_path: Path, textures: str):
    mesh = model(tmp_path / "floor", textures)
    assert resolve_mesh(tmp_path / "floor") == mesh
    assert all(abs(a - b) <= 1 for a, b in zip(color_at(seen_from_above(mesh), 0.3, 0.3), _RED, strict=True))


def test_a_path_that_leads_through_the_model_is_followed_but_not_out_of_it(tmp_path: Path):
    mesh = model(tmp_path / "floor")
    text = mesh.read_text()
    mesh.write_text(text.replace("floor0.png", "../materials/textures/floor0.png"))
    assert imported(mesh).report["textures"] == 1
    (tmp_path / "secret.png").write_bytes((tmp_path / "floor/materials/textures/floor0.png").read_bytes())
    mesh.write_text(text.replace("floor0.png", "../../secret.png"))
    found = imported(mesh)
    guesses = found.report["guesses"]
    assert isinstance(guesses, list) and any("secret.png lies outside its own folder" in guess for guess in guesses)
    assert found.report["textures"] == 0


def test_a_texture_that_the_model_lacks_makes_it_grey_and_says_so(tmp_path: Path):
    mesh = model(tmp_path / "floor")
    (tmp_path / "floor/materials/textures/floor0.png").unlink()
    found = imported(mesh)
    guesses = found.report["guesses"]
    assert isinstance(guesses, list) and any("floor0.png is missing" in guess for guess in guesses)
    assert found.scene.paint is not None and set(found.scene.paint.image_of_face.tolist()) == {-1}


def test_a_folder_of_several_meshes_is_several_places(tmp_path: Path):
    model(tmp_path)
    write_collada([(quad(-1, 1), _RED)], tmp_path / "meshes" / "other.dae")
    assert find_mesh(tmp_path) is None
    with pytest.raises(MeshFileError, match="no mesh or several"):
        resolve_mesh(tmp_path)


def test_shapes_for_collisions_alone_do_not_count_beside_a_mesh_with_colours(tmp_path: Path):
    mesh = model(tmp_path)
    quad(-1, 1).export(tmp_path / "meshes" / "collision.stl")
    assert find_mesh(tmp_path) == mesh
    with zipfile.ZipFile(tmp_path / "model.zip", "w") as archive:
        for file in sorted((tmp_path / "meshes").iterdir()):
            archive.write(file, f"model/meshes/{file.name}")
    names = [PurePosixPath(name) for name in list_archived_meshes(tmp_path / "model.zip")]
    assert len(names) == 2 and select_mesh(names) == PurePosixPath("model/meshes/floor.dae")

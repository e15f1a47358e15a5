"""Robots' files that visitors bring or write."""

from pathlib import Path

import pytest
import trimesh
from trimesh.exchange.stl import export_stl

from nerfnav.core.errors import InvalidInputError
from nerfnav.robots import describe_robot, load, names, to_yaml
from nerfnav_app.places.robot_library import RobotLibrary
from nerfnav_app.places.uploads import UploadError

_MESH = b"name: hull\nkind: quadrotor\nmass: 1\nbody: {mesh: hull.stl}\n"


@pytest.mark.parametrize("name", names())
def test_a_described_robot_is_the_same_robot_again(tmp_path: Path, name: str) -> None:
    reported, meshes = describe_robot(name)
    again, own = load(str(RobotLibrary(tmp_path).keep(reported, meshes))), load(name)
    assert again.bounds == own.bounds and again.camera == own.camera
    assert again.body.points_body.equal(own.body.points_body)


def test_a_robot_keeps_its_file_though_another_of_its_name_comes(tmp_path: Path) -> None:
    library = RobotLibrary(tmp_path)
    reported, meshes = describe_robot("crazyflie")
    first = library.keep(reported, meshes)
    reported.limits = {**reported.limits, "speed": 0.5}
    second = library.keep(reported, meshes)
    assert first != second and first.is_file() and library.files() == (second,)


def test_a_mesh_is_brought_before_the_robot_that_names_it(tmp_path: Path) -> None:
    library = RobotLibrary(tmp_path)
    with pytest.raises(InvalidInputError, match=r"hull\.stl is not here: bring it first"):
        library.brought("own.yaml", _MESH)
    hull = export_stl(trimesh.creation.cone(0.06, 0.1))
    assert library.brought("hull.stl", hull) is None
    file = library.brought("own.yaml", _MESH)
    assert file is not None and load(str(file)).body.solid is not None
    reported, meshes = describe_robot(str(file))
    reported.name = "other"
    assert load(str(library.keep(reported, meshes))).body.solid is not None, "the mesh has not come along"


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("robot.exe", b"x", "is no robot: these are taken"),
        ("robot.yaml", b"", "is no robot"),
        ("robot.yaml", b"[1, 2]", "is no robot file"),
        ("robot.yaml", _MESH.replace(b"hull.stl", b"../../hull.stl"), "without a folder"),
        ("robot.yaml", _MESH.replace(b"mesh: hull.stl", b"box: [0, 1, 1]"), "above 0 m"),
    ],
)
def test_what_is_no_robot_is_refused_and_leaves_nothing(
    tmp_path: Path, name: str, content: bytes, said: str
) -> None:
    library = RobotLibrary(tmp_path)
    with pytest.raises((UploadError, InvalidInputError), match=said) as reported:
        library.brought(name, content)
    assert not library.files() and str(tmp_path) not in str(reported.value)


def test_yaml_leaves_out_what_is_not_told(tmp_path: Path) -> None:
    reported, _ = describe_robot("diffdrive")
    text = to_yaml(reported).decode()
    assert "mass" not in text and "null" not in text and "kind: diffdrive" in text

"""Robots in files."""

import math
import re
from pathlib import Path

import pytest
import torch
import trimesh

from nerfnav import robots
from nerfnav.core.errors import InvalidInputError, UnknownNameError
from nerfnav.robots import Couch, DiffDrive, Quadrotor, RigidState
from nerfnav.robots.body_file import spacing_for
from nerfnav.robots.robots import BUNDLED

SCOUT = """
name: scout
kind: quadrotor
mass: 0.7
body: {box: [0.25, 0.25, 0.08]}
"""


def written(folder: Path, text: str) -> str:
    path = folder / "robot.yaml"
    path.write_text(text)
    return str(path)


@pytest.mark.parametrize("path", sorted(BUNDLED.glob("*.yaml")), ids=lambda path: path.stem)
def test_each_bundled_file_describes_the_robot_that_it_is_named_after(path: Path) -> None:
    robot = robots.load(path.stem)
    assert robot.name == path.stem and path.stem in robots.names()
    assert robots.load(str(path)).body.extents == robot.body.extents


def test_a_quadrotor_of_three_lines_can_do_what_one_of_its_size_and_mass_can(tmp_path: Path) -> None:
    robot, usual = robots.load(written(tmp_path, SCOUT)), robots.load("quadrotor25")
    assert isinstance(robot, Quadrotor) and isinstance(usual, Quadrotor)
    assert robot.config.max_thrust == pytest.approx(usual.config.max_thrust)
    assert robot.config.inertia == pytest.approx(usual.config.inertia, rel=0.02)
    assert robot.config.max_rate == pytest.approx(usual.config.max_rate, rel=0.1)
    assert robot.config.angular_acceleration == pytest.approx(usual.config.angular_acceleration, rel=0.05)
    assert str(robot.file).endswith("robot.yaml") and usual.file is None


def test_numbers_may_be_written_as_in_any_program(tmp_path: Path) -> None:
    robot = robots.load(written(tmp_path, SCOUT + "inertia: [4e-3, 4.0E-3, 7.3e-03]\nlimits: {tilt: 6e-1}\n"))
    assert isinstance(robot, Quadrotor) and robot.config.inertia == (4e-3, 4e-3, 7.3e-3)
    assert robot.config.max_tilt == 0.6


@pytest.mark.parametrize(
    ("kind", "made", "more"), [("couch", Couch, "mass: 3.0"), ("diffdrive", DiffDrive, "limits: {speed: 0.5}")]
)
def test_ground_robots_are_described_as_well(tmp_path: Path, kind: str, made: type, more: str) -> None:
    robot = robots.load(written(tmp_path, f"name: mine\nkind: {kind}\nbody: {{box: [0.3, 0.2, 0.1]}}\n{more}\n"))
    assert isinstance(robot, made) and robot.planar and robot.body.extents == (0.3, 0.2, 0.1)


@pytest.mark.parametrize("size", [0.1, 1.0, 10.0])
@pytest.mark.parametrize(
    ("shape", "extents"),
    [
        ("{{box: [{0:g}, {0:g}, {1:g}]}}", (1, 1, 0.5)),
        ("{{cylinder: {{radius: {1:g}, height: {0:g}}}}}", (1, 1, 1)),
        ("{{spheres: [[0, 0, 0, {1:g}], [{1:g}, 0, 0, {1:g}]]}}", (1.5, 1, 1)),
    ],
)
def test_a_body_has_the_size_and_is_filled_with_points_as_densely_as_its_size_asks(
    tmp_path: Path, shape: str, extents: tuple[float, ...], size: float
) -> None:
    text = SCOUT.replace("{box: [0.25, 0.25, 0.08]}", shape.format(0.3 * size, 0.15 * size))
    body = robots.load(written(tmp_path, text)).body
    assert body.extents == pytest.approx([0.3 * size * edge for edge in extents], rel=0.02)
    between = torch.cdist(body.points_body, body.points_body).fill_diagonal_(torch.inf).amin(1)
    assert between.max() < 2 * spacing_for(body.extents)


def test_a_body_may_be_a_mesh_beside_the_file(tmp_path: Path) -> None:
    trimesh.creation.cone(0.1, 0.3).export(tmp_path / "cone.stl")
    robot = robots.load(written(tmp_path, SCOUT.replace("{box: [0.25, 0.25, 0.08]}", "{mesh: cone.stl}")))
    assert robot.body.solid is not None and robot.body.extents == pytest.approx((0.2, 0.2, 0.3), rel=0.02)


def test_a_body_may_be_the_collision_geometry_of_a_urdf(tmp_path: Path) -> None:
    (tmp_path / "bot.urdf").write_text(
        '<robot name="bot"><link name="base"><collision><geometry><box size="0.4 0.3 0.2"/></geometry></collision>'
        '</link><link name="mast"><collision><origin xyz="0 0 0.2"/><geometry><box size="0.1 0.1 0.2"/></geometry>'
        '</collision></link><joint name="up" type="fixed"><parent link="base"/><child link="mast"/></joint></robot>'
    )
    robot = robots.load(written(tmp_path, SCOUT.replace("{box: [0.25, 0.25, 0.08]}", "{urdf: bot.urdf}")))
    assert robot.body.extents == pytest.approx((0.4, 0.3, 0.4), rel=0.01)


def test_a_robot_sees_with_the_camera_that_its_file_names(tmp_path: Path) -> None:
    text = SCOUT + "camera: {position: [0.1, 0, 0.05], pitch: 0.5, width: 64, height: 48, fov: 60}\n"
    robot = robots.load(written(tmp_path, text))
    assert (robot.camera.width, robot.camera.height) == (64, 48)
    seen = RigidState.at_rest((1.0, 2.0, 3.0), 0.0).pose.compose(robot.mount)
    torch.testing.assert_close(seen.position, torch.tensor([1.1, 2.0, 3.05]))
    ahead = -seen.rotation[:, 2]
    torch.testing.assert_close(ahead, torch.tensor([0.5, 0.0, -0.5]).cos() * torch.tensor([1.0, 0, 0])
                               + torch.tensor([0.0, 0.0, -0.479425538604203]))  # fmt: skip


def test_a_robot_is_found_again_by_its_source_from_any_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written(tmp_path, SCOUT)
    monkeypatch.chdir(tmp_path)
    robot = robots.load("robot.yaml")
    monkeypatch.chdir("/")
    assert robots.load(robot.source).name == "scout" and robots.is_known(robot.source)
    assert robots.load("couch").source == "couch" and not robots.is_known("robot.yaml")


def test_a_name_that_is_no_robot_is_refused_with_the_known_ones() -> None:
    with pytest.raises(UnknownNameError, match="crazyflie"):
        robots.load("drone")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("mass: 0.7", "mass: -1"), "mass is a number above 0"),
        (("mass: 0.7", "mass: .nan"), "mass is a number above 0"),
        (("mass: 0.7\n", ""), "mass is missing"),
        (("mass: 0.7", "mass: heavy"), "mass"),
        (("kind: quadrotor", "kind: boat"), "boat"),
        (("name: scout", "name: ' '"), "needs a name"),
        (("0.08]}", "0.08]}\ninertia: [1e-3, 1e-3, -1e-3]"), "inertia is a number above 0"),
        (("0.08]}", "0.08]}\ninertia: [1e-3, 1e-3, 1e-2]"), "none exceeds the sum"),
        (("0.08]}", "0.08]}\ninertia: [4e-3, 4e-3, 1e-30]"), "leave inertia out"),
        (("0.08]}", "0.08]}\ninertia: [4e3, 4e3, 4e3]"), "leave inertia out"),
        (("mass: 0.7", "mass: 1e300"), "mass is a number from 0.0001 to "),
        (("0.08]}", "0.08]}\nlimits: {speed: 1e-300}"), "speed is a number from 0.0001 to "),
        (("0.08]}", "0.08]}\nlimits: {thrust: 6.8}"), "does not lift 0.7 kg: more than 6.87 N"),
        (("0.08]}", "0.08]}\nlimits: {tilt: 35}"), "in degrees"),
        (("0.08]}", "0.08]}\nlimits: {force: 35}"), "no limit 'force'"),
        (("0.08]}", "0.08]}\nlimits: {speed: 0}"), "speed is a number above 0"),
        (("0.08]}", "0.08]}\npropellers: 4"), "propellers"),
        (("box: [0.25, 0.25, 0.08]", "box: [0.25, 0.25, 0]"), "above 0 m"),
        (("box: [0.25, 0.25, 0.08]", "box: [0.25, 0.25]"), "length 3"),
        (("box: [0.25, 0.25, 0.08]", "box: [0.25, 0.25, 0.08], points: [100, 100, 100]"), "at most 5000"),
        (("box: [0.25, 0.25, 0.08]", "box: [1, 1, 1], mesh: a.stl"), "2 of them"),
        (("box: [0.25, 0.25, 0.08]", "spacing: 0.02"), "0 of them"),
        (("box: [0.25, 0.25, 0.08]", "mesh: none.stl"), "there is no mesh"),
        (("box: [0.25, 0.25, 0.08]", "spheres: []"), "at least one"),
        (("box: [0.25, 0.25, 0.08]", "spheres: [[0, 0, .inf, 1]]"), "above 0 m"),
        (("box: [0.25, 0.25, 0.08]", "cylinder: {radius: 200, height: 100}"), "other units"),
        (("box: [0.25, 0.25, 0.08]", "spheres: [[0, 0, 0, 0.1], [9e18, 0, 0, 0.1]]"), "5 m long, not 9e+18 m"),
        (("box: [0.25, 0.25, 0.08]", "spheres: [[0, 0, 0, 0.1], [.nan, 0, 0, 0.1]]"), "above 0 m"),
        (("box: [0.25, 0.25, 0.08]", "box: [1e300, 1e300, 1e300]"), "5 m long, not 1e+300 m"),
        (("box: [0.25, 0.25, 0.08]", "box: [0.25, 0.25, 0.08], spacing: 0"), "above 0 m"),
        (("box: [0.25, 0.25, 0.08]", "cylinder: {radius: 0.1, height: 1e30}"), "5 m long"),
        (("0.08]}", "0.08]}\ncamera: {width: 0}"), "positive size"),
        (("0.08]}", "0.08]}\ncamera: {width: 1000000}"), "at most 8192 pixels"),
        (("mass: 0.7", f"mass: {'9' * 5000}"), "is no robot file"),
        (("0.08]}", "0.08]}\ncamera: {pitch: 40}"), "1.57 rad"),
        (("0.08]}", "0.08]}\ncamera: {fov: 190}"), "field of view"),
        (("0.08]}", "0.08]}\ncamera: {file: none.yaml}"), "there is no calibration"),
    ],
)
def test_a_robot_that_cannot_be_is_refused_in_one_sentence(tmp_path: Path, change: tuple[str, str], said: str) -> None:
    assert change[0] in SCOUT
    with pytest.raises(InvalidInputError, match=r"robot\.yaml") as raised:
        robots.load(written(tmp_path, SCOUT.replace(*change)))
    assert said in str(raised.value) and "\n" not in str(raised.value)


@pytest.mark.parametrize("text", ["", "[1, 2]", "name: [", "\x00", "name: a\nname: b"])
def test_what_is_no_robot_file_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(InvalidInputError, match="no robot file"):
        robots.load(written(tmp_path, text))


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="there is no robot file"):
        robots.load(str(tmp_path / "none.yaml"))


@pytest.mark.parametrize(("kind", "extra"), [("diffdrive", "mass: 1"), ("couch", "mass: 1\ninertia: [1, 1, 1]")])
def test_what_a_kind_does_not_have_is_refused(tmp_path: Path, kind: str, extra: str) -> None:
    with pytest.raises(InvalidInputError, match=f"a {kind} moves without"):
        robots.load(written(tmp_path, f"name: a\nkind: {kind}\nbody: {{box: [0.3, 0.2, 0.1]}}\n{extra}\n"))


def _body(shape: str) -> str:
    return SCOUT.replace("{box: [0.25, 0.25, 0.08]}", shape)


@pytest.mark.parametrize(
    ("mesh", "said"),
    [
        (None, "must have triangles"),
        (trimesh.creation.box((0.3, 0.2, 0.1)).slice_plane((0, 0, 0), (0, 0, 1)), "must be closed"),
        (trimesh.Trimesh([[0, 0, 0], [0.3, 0, 0], [0, 0.2, 0]], [[0, 1, 2]]), "must be closed"),
        (trimesh.creation.box((300, 200, 100)), "5 m long, not 300 m"),
        (trimesh.creation.box((3e-4, 2e-4, 1e-4)), "0.005 to 5 m long, not 0.0003 m"),
        (trimesh.Trimesh([[0, 0, math.nan], [0.3, 0, 0], [0, 0.2, 0]], [[0, 1, 2]], process=False), "finite"),
    ],
)
def test_a_mesh_that_is_no_body_is_refused(mesh: trimesh.Trimesh | None, said: str, tmp_path: Path) -> None:
    if mesh is None:
        (tmp_path / "hull.stl").write_bytes(b"")
    else:
        mesh.export(tmp_path / "hull.stl")
    with pytest.raises(InvalidInputError, match=said):
        robots.load(written(tmp_path, _body("{mesh: hull.stl}")))
    if said != "must be closed":  # a hull closes it
        mesh_of_urdf = '<collision><geometry><mesh filename="hull.stl"/></geometry></collision>'
        (tmp_path / "bot.urdf").write_text(f'<robot name="bot"><link name="base">{mesh_of_urdf}</link></robot>')
        with pytest.raises(InvalidInputError, match=said):
            robots.load(written(tmp_path, _body("{urdf: bot.urdf}")))


def test_a_flat_mesh_has_no_hull(tmp_path: Path) -> None:
    trimesh.Trimesh([[0, 0, 0], [0.3, 0, 0], [0, 0.2, 0]], [[0, 1, 2]]).export(tmp_path / "hull.stl")
    with pytest.raises(InvalidInputError, match="no convex hull"):
        robots.load(written(tmp_path, _body("{mesh: hull.stl, hull: true}")))


@pytest.mark.parametrize(
    ("geometry", "said"),
    [
        ('<mesh filename="package://bot/gone.stl"/>', "gone.stl cannot be read as a mesh"),
        ('<capsule radius="1" length="2"/>', "'capsule'; known are box, cylinder, sphere, mesh"),
        ('<box size="nan 1 1"/>', "bot.urdf"),
        ('<box size="1 1"', "bot.urdf cannot be read as a URDF"),
    ],
)
def test_a_urdf_of_which_a_part_would_be_left_out_is_refused(geometry: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "bot.urdf").write_text(
        '<robot name="bot"><link name="base"><collision><geometry><box size="0.4 0.3 0.2"/></geometry></collision>'
        f'</link><link name="mast"><collision><geometry>{geometry}</geometry></collision></link><joint name="up" '
        'type="fixed"><parent link="base"/><child link="mast"/></joint></robot>'
    )
    with pytest.raises(InvalidInputError, match=re.escape(said)):
        robots.load(written(tmp_path, _body("{urdf: bot.urdf}")))


def test_a_mesh_whose_faces_look_inwards_is_turned_outwards(tmp_path: Path) -> None:
    inverted = trimesh.creation.box((0.3, 0.2, 0.1))
    inverted.invert()
    inverted.export(tmp_path / "hull.ply")
    robot = robots.load(written(tmp_path, _body("{mesh: hull.ply, spacing: 0.05}")))
    assert robot.body.solid is not None and robot.body.solid.volume == pytest.approx(0.006)


def test_limits_that_follow_from_a_large_mass_are_taken(tmp_path: Path) -> None:
    robot = robots.load(written(tmp_path, SCOUT.replace("mass: 0.7", "mass: 9e5")))
    assert isinstance(robot, Quadrotor) and robot.config.max_thrust > 9e6

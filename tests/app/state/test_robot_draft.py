"""Numbers of robots as people read and change them."""

import math
from pathlib import Path

import msgspec
import pytest

from nerfnav.core.errors import InvalidInputError
from nerfnav.robots import LIMITS, BodyFile, CouchConfig, Kind, QuadrotorConfig, describe_robot, names, robot_of
from nerfnav_app.state.robot_draft import (
    KINDS,
    NUMBERS,
    DiscardEdits,
    EditRobot,
    box_of,
    edit_kind,
    make_cylinder,
    name_shape,
)
from nerfnav_app.state.session import Session
from tests.app.sessions import after


@pytest.mark.parametrize("name", names())
def test_each_number_is_read_and_written_in_its_unit(name: str) -> None:
    told, meshes = describe_robot(name)
    for number in NUMBERS:
        value = number.of(told)
        if value is not None:
            edited = number.edit(told, value).of(None)
            assert number.of(edited) == pytest.approx(value)
            robot_of(edited, meshes)


def test_angles_are_degrees_for_people_and_radians_in_the_file() -> None:
    told, _ = describe_robot("quadrotor")
    tilt = next(number for number in NUMBERS if number.name == "tilt")
    assert tilt.of(told) == pytest.approx(math.degrees(1.2))
    assert tilt.edit(told, 45.0).of(None).limits["tilt"] == pytest.approx(math.pi / 4)


def test_moments_of_inertia_are_told_in_gram_square_metres_and_changed_one_by_one() -> None:
    told, _ = describe_robot("crazyflie")
    about = {number.name: number for number in NUMBERS if number.part == "inertia"}
    assert about["x"].of(told) == pytest.approx(0.0166) and about["z"].of(told) == pytest.approx(0.0293)
    first = about["x"].edit(told, 0.02).of(None)
    both = about["z"].edit(told, 0.03).of(first)
    assert both.inertia == pytest.approx((2e-5, 1.66e-5, 3e-5))
    assert about["x"].of(describe_robot("cart")[0]) is None


def test_moments_of_inertia_that_no_file_tells_are_told_as_they_come_out(tmp_path: Path) -> None:
    paper, _ = describe_robot("quadrotor")
    assert paper.inertia == QuadrotorConfig().inertia
    file = tmp_path / "plank.yaml"
    file.write_text("name: plank\nkind: quadrotor\nmass: 1.2\nbody: {box: [0.3, 0.2, 0.1]}\n")
    plank, _ = describe_robot(str(file))
    assert plank.inertia == pytest.approx((0.1 * 0.05, 0.1 * 0.1, 0.1 * 0.13)), "of a solid box"


def test_a_camera_is_moved_along_one_axis_and_a_calibrated_one_keeps_what_its_file_says() -> None:
    told, meshes = describe_robot("quadrotor")
    ahead = next(number for number in NUMBERS if (number.part, number.name) == ("position", "x"))
    pitch = next(number for number in NUMBERS if number.name == "pitch")
    moved = pitch.edit(told, 30.0).of(ahead.edit(told, 0.05).of(None))
    assert robot_of(moved, meshes).mount.position.tolist() == pytest.approx([0.05, 0, 0])
    assert moved.camera is not None and moved.camera.pitch == pytest.approx(math.pi / 6)
    calibrated = msgspec.structs.replace(moved, camera=msgspec.structs.replace(moved.camera, file="camera.yaml"))
    assert [n.name for n in NUMBERS if n.part in ("camera", "position") and n.of(calibrated) is not None] == [
        "x", "y", "z", "pitch"
    ]  # fmt: skip


def test_changes_come_together_until_they_are_forgotten_or_another_robot_is_taken(opened: Session) -> None:
    told, _ = describe_robot("quadrotor")
    edits = EditRobot(told, "", "mass", 0.4), EditRobot(told, "camera", "fov", 70.0)
    both = after(opened, *edits)
    assert both.robot_draft is not None and both.robot_draft.camera is not None
    assert (both.robot_draft.mass, both.robot_draft.camera.fov) == (0.4, 70.0)
    assert told.mass == 0.25, "what is chosen has changed"
    assert after(both, DiscardEdits()).robot_draft is None


def test_bodies_change_their_shape() -> None:
    body = BodyFile(box=(0.2, 0.1, 0.05))
    assert name_shape(make_cylinder(body, 0.1, 0.05)) == "cylinder" and name_shape(box_of(body, (1, 1, 1))) == "box"


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["quadrotor", "couch", "turtlebot3"])
def test_another_kind_keeps_body_and_camera_and_has_all_that_it_needs(name: str, kind: Kind) -> None:
    told, meshes = describe_robot(name)
    moved = edit_kind(told, None, kind, meshes).of(None)
    assert (moved.name, moved.body, moved.camera) == (told.name, told.body, told.camera)
    assert moved.kind == kind and moved.limits.keys() == LIMITS[kind].keys()
    assert (moved.mass is None) == (kind in ("diffdrive", "handheld"))
    assert (moved.inertia is None) == (kind != "quadrotor")
    robot = robot_of(moved, meshes)
    assert robot.body.extents == pytest.approx(robot_of(told, meshes).body.extents)
    assert edit_kind(told, moved, told.kind, meshes).of(moved) == told, "it is another one than at first"


def test_what_another_kind_needs_is_the_bundled_robots_at_this_size_and_mass() -> None:
    quadrotor, meshes = describe_robot("quadrotor")
    heavy = EditRobot(quadrotor, "", "mass", 2.0).of(None)
    couch = edit_kind(quadrotor, heavy, "couch", meshes).of(heavy)
    assert couch.mass == 2.0 and couch.limits["force"] == pytest.approx(2.0 * CouchConfig().max_force)
    cart, _ = describe_robot("turtlebot3")
    flying, usual = edit_kind(cart, None, "quadrotor", meshes).of(None), QuadrotorConfig()
    assert flying.mass == usual.mass and flying.limits["thrust"] == pytest.approx(usual.max_thrust)
    assert flying.limits["body_rate"] < usual.max_rate, "a larger body turns more slowly"
    assert flying.limits["speed"] == usual.max_speed, "of what it was before"


def test_a_kind_that_this_robot_cannot_be_is_refused(tmp_path: Path) -> None:
    told, meshes = describe_robot("quadrotor")
    with pytest.raises(InvalidInputError, match="mass is a number above 0, not -1"):
        edit_kind(told, EditRobot(told, "", "mass", -1.0).of(None), "couch", meshes)
    hull = msgspec.structs.replace(told, body=BodyFile(mesh="hull.stl"))
    with pytest.raises(InvalidInputError, match="hull"):
        edit_kind(hull, None, "couch", tmp_path)

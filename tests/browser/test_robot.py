"""The robot's numbers in the page: seen with their units, changed, refused, taken, saved and loaded."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from nerfnav.robots import DiffDrive, load
from nerfnav_app.server import App
from nerfnav_app.state.robot_draft import KINDS, NUMBERS
from tests.app.doubles import ScriptedWork
from tests.browser.tab import Tab

Serve = Callable[..., App]
OpenTab = Callable[[App], Tab]


@pytest.fixture
def tab(serve: Serve, open_tab: OpenTab) -> Tab:
    """A tab with the robot's numbers unfolded."""
    tab = open_tab(serve(ScriptedWork()))
    tab.unfold("robot.name")
    return tab


def typed(tab: Tab, label: str, value: str) -> None:
    """Type into a number of the panel."""
    tab.until_shown()
    before = tab.app.session.robot_draft
    tab.page.get_by_label(label, exact=True).fill(value)
    tab.until(lambda: tab.app.session.robot_draft is not before, f"{label} is not told")


def test_a_robot_is_changed_taken_saved_and_loaded_again(tab: Tab, tmp_path: Path) -> None:
    app = tab.app
    has = {"mass", "thrust", "tilt", "speed", "body_rate", "angular_acceleration", "width", "height", "fov", "pitch"}
    has |= {"x", "y", "z"}  # of the inertia and the camera
    for number in NUMBERS:
        box = tab.page.get_by_label(number.label, exact=True)
        tab.until(lambda box=box, number=number: box.is_visible() == (number.name in has), f"{number.label}: wrong")
    tab.fill("robot.name", "heavy")
    tab.until(lambda: app.session.robot_draft is not None, "the name is not told")
    typed(tab, "Mass [kg]", "0.4")
    typed(tab, "Inertia about z [g m²]", "0.35")
    typed(tab, "Field of view [°]", "70")
    typed(tab, "Camera x, forward [m]", "0.04")
    tab.until_shown()
    tab.choose("robot.shape", "cylinder")
    tab.until(lambda: tab.says("Edited: "), "nobody says that it is not taken yet")
    assert app.session.place is not None and app.session.place.robot.name == "quadrotor"
    tab.button("robot.use").click()
    tab.until(lambda: app.session.place is not None and app.session.place.robot.name == "heavy", "it was not taken")
    robot = app.session.place.robot
    assert robot.body.solid is not None and robot.body.extents[0] == pytest.approx(0.1, abs=1e-3)
    assert app.session.robot_draft is None
    tab.until(lambda: tab.box("place.robots.list").input_value() == "heavy", "the list has it not")
    saved = tab.download("robot.save")
    file = tmp_path / "mine.yaml"
    file.write_bytes(saved.read_bytes().replace(b"name: heavy", b"name: mine"))
    own = load(str(file))
    assert own.config.inertia == pytest.approx((2.4e-4, 2.4e-4, 3.5e-4))  # type: ignore
    assert own.mount.position.tolist() == pytest.approx([0.04, 0, 0])
    assert own.config.mass == pytest.approx(0.4) and own.camera.fx == pytest.approx(robot.camera.fx)  # type: ignore
    with tab.page.expect_file_chooser() as chooser:
        tab.button("robot.load").click()
    chooser.value.set_files(file)
    tab.until(lambda: app.session.place is not None and app.session.place.robot.name == "mine", "it was not loaded")


def test_a_robot_becomes_one_of_another_kind(tab: Tab, tmp_path: Path) -> None:
    app = tab.app

    def needs(*names: str) -> None:
        for number in NUMBERS:
            if number.part in ("", "inertia", "limits"):
                box = tab.page.get_by_label(number.label, exact=True)
                shown = number.name in names or (number.part == "inertia" and "inertia" in names)
                tab.until(lambda box=box, shown=shown: box.is_visible() == shown, f"{number.label}: wrong")

    tab.fill("robot.name", "rover")
    tab.until(lambda: app.session.robot_draft is not None, "the name is not told")
    tab.until_shown()
    tab.choose("robot.kind", KINDS["couch"])
    needs("mass", "speed", "yaw_rate", "force")
    typed(tab, "Maximum force [N]", "6")
    tab.until_shown()
    tab.choose("robot.kind", KINDS["handheld"])
    needs()
    tab.until(lambda: tab.says("Rover is carried by hand: it can be tracked, not planned for"), "nobody says so")
    use = tab.button("robot.use")
    tab.until(use.is_disabled, "what is carried can be planned for")
    tab.choose("robot.kind", KINDS["diffdrive"])
    needs("speed", "yaw_rate", "acceleration", "yaw_acceleration")
    tab.until(use.is_enabled, "it cannot be taken")
    use.click()
    tab.until(lambda: app.session.place is not None and app.session.place.robot.name == "rover", "it was not taken")
    assert app.session.place is not None
    robot = app.session.place.robot
    assert isinstance(robot, DiffDrive) and robot.body.extents == (0.1, 0.1, 0.04)
    tab.until(lambda: tab.box("robot.kind").input_value() == KINDS["diffdrive"], "it is another")
    saved = tab.download("robot.save")
    file = tmp_path / "mine.yaml"
    file.write_bytes(saved.read_bytes().replace(b"name: rover", b"name: mine"))
    own = load(str(file))
    assert isinstance(own, DiffDrive) and own.config == replace(robot.config, name="mine")
    carried = tmp_path / "carried.yaml"
    carried.write_text("name: phone\nkind: handheld\nbody: {box: [0.1, 0.1, 0.1]}\n")
    for brought in (file, carried):
        with tab.page.expect_file_chooser() as chooser:
            tab.button("robot.load").click()
        chooser.value.set_files(brought)
        tab.until(lambda: app.session.place is not None and app.session.place.robot.name == "mine", "not loaded")
    tab.until(lambda: tab.says("Phone is carried by hand"), "nobody says why it is not taken")
    assert app.session.place.robot.name == "mine"


def test_a_kind_that_a_robot_cannot_be_is_refused_in_one_sentence(tab: Tab) -> None:
    typed(tab, "Mass [kg]", "-1")
    tab.until_shown()
    tab.choose("robot.kind", KINDS["couch"])
    tab.until(lambda: tab.says("Not applied"), "the page does not say that it is rejected")
    kind = tab.box("robot.kind")
    tab.until(lambda: kind.input_value() == "quadrotor", "the list says what it is not")
    draft = tab.app.session.robot_draft
    assert draft is not None and draft.kind == "quadrotor"


def test_numbers_that_cannot_be_are_said_and_not_taken(tab: Tab) -> None:
    for label, bad, good, said in (
        ("Maximum thrust [N]", "1", "7", "A thrust of 1 N does not lift 0.25 kg"),
        ("Inertia about z [g m²]", "0.5", "0.3", "none exceeds the sum of the two others"),
        ("Inertia about x [g m²]", "-0.1", "0.3", "inertia is a number above 0, not -0.0001"),
    ):
        box, use = tab.page.get_by_label(label, exact=True), tab.button("robot.use")
        before = box.input_value()
        typed(tab, label, bad)
        tab.until(lambda said=said: tab.says(said), "nobody says what is wrong")
        tab.until(use.is_disabled, "what cannot be can be taken")
        typed(tab, label, good)
        tab.until(lambda said=said: not tab.says(said), "the complaint has outlived its cause")
        tab.until(use.is_enabled, "what is right cannot be taken")
        tab.button("robot.discard").click()
        tab.until(lambda box=box, before=before: box.input_value() == before, "it was not forgotten")


def test_files_that_are_no_robots_are_refused_in_one_sentence(tab: Tab, tmp_path: Path) -> None:
    bad = tmp_path / "bad.yaml"
    bad.write_text("name: bad\nkind: quadrotor\nmass: -1\nbody: {box: [0.1, 0.1, 0.1]}\n")
    missing = tmp_path / "missing.yaml"
    missing.write_text("name: hull\nkind: quadrotor\nmass: 1\nbody: {mesh: hull.stl}\n")
    for file, said in ((bad, "mass is a number above 0, not -1"), (missing, "hull.stl is not here")):
        with tab.page.expect_file_chooser() as chooser:
            tab.button("robot.load").click()
        chooser.value.set_files(file)
        tab.until(lambda said=said: tab.says(said), "nobody says what is wrong")
    assert tab.app.session.choice.robot == "quadrotor"

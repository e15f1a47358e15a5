"""Changes of a person: undone and done again, refused where they cannot be, and what their pictures show."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from nerfnav.robots import Robot
from nerfnav_app.page.kit.theme import PLAN, linear
from nerfnav_app.page.layers.ends import GIZMO
from nerfnav_app.page.layers.plan import color_by_clearance
from nerfnav_app.page.panels.status.status import describe_outside
from nerfnav_app.places.ends import EndRole
from nerfnav_app.queries.clearance import ClearanceQuery
from nerfnav_app.server import App
from nerfnav_app.state.actions import Choose
from nerfnav_app.state.place import Choice
from tests.app.doubles import ScriptedWork
from tests.browser.tab import Tab
from tests.browser.works import small_work

Serve = Callable[..., App]
OpenTab = Callable[[App], Tab]


def test_a_drag_is_undone_by_key_and_button_and_done_again(serve: Serve, open_tab: OpenTab) -> None:
    app = serve(ScriptedWork())
    tab = open_tab(app)
    before = app.session.ends.goal
    tab.drag_along_x(EndRole.GOAL, -0.3, GIZMO)
    moved = app.session.ends.goal
    assert moved != before
    tab.key("Control+z")
    tab.until(lambda: app.session.ends.goal == before, "the key has not undone it")
    tab.until_ends_agree()
    tab.key("Control+y")
    tab.until(lambda: app.session.ends.goal == moved, "the key has not done it again")
    tab.until_ends_agree()
    tab.press("status.undo")
    tab.until(lambda: app.session.ends.goal == before, "the button has not undone it")
    tab.press("status.redo")
    tab.until(lambda: app.session.ends.goal == moved, "the button has not done it again")


def test_a_typed_setting_is_undone_in_its_widget(serve: Serve, open_tab: OpenTab) -> None:
    app = serve(ScriptedWork())
    tab = open_tab(app)
    tab.turn_to("Plan")
    box = tab.box("plan.settings.duration")
    before = app.session.plan_settings
    box.fill("3.5")
    tab.until(lambda: app.session.plan_settings.duration_s == 3.5, "the duration was not taken")
    tab.press("status.undo")
    tab.until(lambda: app.session.plan_settings == before, "it was not undone")
    tab.until(lambda: float(box.input_value().split()[0]) == before.duration_s, "the widget shows what was undone")


def test_typed_numbers_outside_of_the_place_are_said_and_stay_until_they_are_right(
    serve: Serve, open_tab: OpenTab
) -> None:
    app = serve(ScriptedWork())
    tab = open_tab(app)
    before = app.session.ends.goal
    tab.turn_to("Scene")
    boxes = tab.boxes("ends.numbers.goal.position")

    def fill(axis: int, value: float) -> None:
        boxes.nth(axis).fill(f"{value:g}")
        boxes.nth(axis).press("Enter")
        # the next number is sent together with what the page has of this one
        tab.until(lambda: typed()[axis] == value, "a number is not told")
        tab.until_shown()

    def typed() -> tuple[float, float, float]:
        session = app.session
        return session.outside.get(EndRole.GOAL, session.ends.goal).position

    for axis in range(3):
        fill(axis, 5)
    tab.until(lambda: tab.says(describe_outside(app.session)), "the page does not say that it was rejected")
    assert app.session.ends.goal == before
    tab.page.wait_for_timeout(500)
    assert [float(boxes.nth(axis).input_value()) for axis in range(3)] == [5, 5, 5], "it was silently undone"
    for axis, value in enumerate((0.5, -0.5, 0.4)):
        fill(axis, value)
    tab.until(lambda: app.session.ends.goal.position == (0.5, -0.5, 0.4), "what is right was not taken")
    tab.until(lambda: not tab.says("The goal cannot be at"), "the complaint has outlived its cause")


def test_the_line_takes_the_colours_of_its_clearance_with_a_scale_and_gives_them_back(
    serve: Serve, open_tab: OpenTab
) -> None:
    app = serve(small_work())
    tab = open_tab(app)

    def rows() -> np.ndarray | None:
        session = app.session
        return ClearanceQuery.result_shown(session)

    tab.press("status.next.start_plan")
    tab.until_planned()
    tab.unfold("view_settings.camera")
    tab.box("view_settings.clearance").click()
    tab.until(lambda: app.session.view_settings.clearance, "the press was not taken")
    tab.until(lambda: rows() is not None, "its room is not known")
    tab.until(lambda: tab.is_visible("/plan/room"), "the line keeps its one colour")

    known = rows()
    assert known is not None
    wanted = np.repeat(linear(color_by_clearance(known.rows))[:, None], 2, axis=1).reshape(-1).tolist()
    tab.until(lambda: tab.property("/plan/room", "colors") == wanted, "the line has other colours")
    tab.until(lambda: tab.says("cm of clearance"), "there is no scale")
    tab.box("view_settings.clearance").click()
    tab.until(lambda: not tab.is_visible("/plan/room"), "it keeps them")
    tab.until(lambda: tab.property("/plan/line", "colors") == list(PLAN), "its one colour does not come back")
    tab.until(lambda: not tab.says("cm of clearance"), "the scale stays")


BODIES = {
    "cylinder": "{cylinder: {radius: 0.1, height: 0.05}}",
    "spheres": "{spheres: [[0, 0, 0, 0.06], [0.08, 0, 0, 0.04]]}",
    "mesh": "{mesh: hull.stl}",
}


def test_the_real_body_is_drawn(serve: Serve, open_tab: OpenTab, tmp_path: Path) -> None:
    import trimesh

    trimesh.creation.cone(0.06, 0.1).export(tmp_path / "hull.stl")
    app = serve(ScriptedWork())
    tab = open_tab(app)
    for kind, body in BODIES.items():
        file = tmp_path / f"{kind}.yaml"
        file.write_text(f"name: {kind}\nkind: quadrotor\nmass: 0.3\nbody: {body}\n")
        app.post(Choose(Choice(robot=str(file))))
        tab.until(lambda kind=kind: robot_of(app).name == kind, "it was not taken")
        solid = robot_of(app).body.solid
        assert solid is not None
        corners = np.asarray(solid.vertices)
        tab.until(lambda corners=corners: is_drawn(tab, corners), "another body is drawn")


def robot_of(app: App) -> Robot:
    """The robot of the open place."""
    assert app.session.place is not None
    return app.session.place.robot


def is_drawn(tab: Tab, corners: np.ndarray) -> bool:
    """Whether the body at the goal has these corners (n, 3): the page holds them as bytes of floats."""
    held = np.array(tab.property("/goal/body", "vertices"), dtype=np.float64).reshape(-1, 3)[: len(corners)]
    return len(held) == len(corners) and np.allclose(held, corners, atol=1e-5)

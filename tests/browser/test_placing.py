"""A person turns splats upright that lie on their side, measures and crops them, and plans in them."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from nerfnav.planner.steps import PlanOutcome
from nerfnav_app.page.layers.alignment import GIZMO
from nerfnav_app.places.ends import End, EndRole
from nerfnav_app.places.library import PlaceLibrary
from nerfnav_app.server import App
from nerfnav_app.state.actions import MoveEnd
from nerfnav_app.state.alignment import AlignmentDraft, Vector
from tests.browser.in_page import POSITION
from tests.browser.tab import Tab
from tests.browser.test_uploads import opening_work
from tests.importers.splat_files import Gaussians, write_dot_splat

FLOOR: tuple[Vector, ...] = ((-0.4, 0.0, -0.4), (0.3, 0.0, -0.3), (-0.2, 0.0, 0.4))
"""Points of the floor as it lies at first [m]."""


def corner_of_splats(count: int = 24) -> Gaussians:
    """A floor of 1.2 m and a wall on it, whose up is -z of the file: programs take -y for it."""
    u, v = (grid.ravel() for grid in np.meshgrid(*2 * [np.linspace(-0.6, 0.6, count)]))
    floor = np.stack([u, v, 0 * u], 1)
    wall = np.stack([0 * u + 0.6, v, u - 0.6], 1)
    upright, lying = (1.0, 0.0, 0.0, 0.0), (0.5**0.5, 0.0, 0.5**0.5, 0.0)
    centers = np.concatenate([floor, wall])
    wxyzs = np.repeat([upright, lying], len(u), 0)
    wide = 0.8 * 1.2 / count
    rgbs = 0.5 + 0.4 * np.sin(9 * centers)
    return Gaussians(centers, np.tile([wide, wide, 0.004], (2 * len(u), 1)), wxyzs, rgbs, np.full(2 * len(u), 0.98))


def test_splats_that_lie_on_their_side_are_turned_upright_measured_cropped_and_planned_in(
    serve: Callable[..., App], open_tab: Callable[[App], Tab], tmp_path: Path
) -> None:
    write_dot_splat(tmp_path / "corner.splat", corner_of_splats())
    app = serve(opening_work())
    tab = open_tab(app)
    tab.turn_to("Scene")
    first = app.session.place
    tab.upload("place.upload", tmp_path / "corner.splat")
    tab.until(lambda: app.session.place is not first and app.session.job is None, "the splats were not opened")
    tab.until(lambda: tab.has_node("/splats"), "the place is not shown")
    tab.unfold("alignment.gizmo")
    before, what = app.session.place, app.session.what
    assert before is not None

    def draft() -> AlignmentDraft:
        return app.session.alignment

    def click(*points: Vector) -> None:
        for count, point in enumerate(points, 1):
            tab.click_at(draft().now.point_after(point))
            done = count == len(points)
            tab.until(lambda n=count, d=done: d or len(draft().picked) == n, "the click showed no point")
        tab.until(lambda: draft().pointing is None, "the last click showed no point")

    tab.press("alignment.level", "three points")
    tab.until(lambda: draft().pointing is not None, "the page does not wait for clicks")
    click(*FLOOR)
    tab.until(lambda: draft().now.is_moved and not tab.is_visible("/start"), "three points did not level the place")
    np.testing.assert_allclose(-draft().now.similarity.rotation[:, 1].numpy(), [0, 0, 1], atol=0.05)
    tab.press("alignment.measure")
    tab.until(lambda: draft().pointing is not None, "the page does not wait for clicks")
    click(*FLOOR[:2])
    tab.until(lambda: tab.box("alignment.distance").is_visible(), "no distance is asked for")
    tab.until_shown()  # or it would put what was measured over what is typed
    tab.box("alignment.distance").fill(f"{2 * (draft().length or 0):.4f}")
    tab.box("alignment.distance").press("Enter")
    tab.until(lambda: draft().now.similarity.scale == pytest.approx(2, rel=1e-3), "the distance was not taken")

    tab.check("alignment.gizmo")
    tab.until(lambda: tab.is_visible("/alignment/gizmo"), "no gizmo is shown")
    tab.until_shown()
    at = np.array(tab.page.evaluate(POSITION, "/alignment/gizmo"))
    turned = draft().now.pose(before.field.box)
    arrow = turned.rotation.numpy()[:, 0] * GIZMO * float(draft().now.box(before.field.box).size.max())
    tab.drag(at + 0.8 * arrow, at + 1.3 * arrow)
    moved = at + 0.5 * arrow
    tab.until(lambda: not draft().held and len(draft().past) == 3, "the hand did not move the place")
    np.testing.assert_allclose(draft().now.pose(before.field.box).position, moved, atol=0.15)

    tab.box("alignment.crop").click()
    tab.until(lambda: draft().now.crop is not None and tab.is_visible("/alignment/kept"), "the box is not shown")
    tab.press("alignment.apply")
    tab.until(lambda: app.session.what != what and app.session.job is None, "the place was not put right", 240)
    now = app.session.place
    assert now is not None and draft() == AlignmentDraft(undo=(what,), changes=draft().changes) and draft().changes
    assert now.splats is not None
    sizes = now.field.box.size[[0, 2, 1]] / before.field.box.size
    assert float(sizes.min()) > 1.9 and float(sizes.max()) < 2.3
    tab.until(lambda: tab.is_visible("/splats") and tab.is_visible("/start"), "the place is not shown as before")
    assert app.session.what in [place.what for place in PlaceLibrary().entries()], "it is lost at the end"

    x, y, z = now.field.box.center.tolist()
    for which, shift in ((EndRole.START, -0.5), (EndRole.GOAL, 0.5)):
        app.post(MoveEnd(which, End((x, y + shift, z))))
    tab.until_ends_agree()
    tab.press("status.next.start_plan")
    tab.until(lambda: app.session.plan is not None and app.session.job is None, "nothing was planned")
    plan = app.session.plan
    assert plan is not None and plan.outcome is PlanOutcome.CONVERGED
    tab.turn_to("Scene")
    tab.press("alignment.undo")
    tab.until(lambda: app.session.what == what and app.session.job is None, "the change was not undone")
    place = app.session.place
    assert place is not None and place.field.box.size.tolist() == before.field.box.size.tolist()

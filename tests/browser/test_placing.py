"""A person puts a place right by hand, measure, floor and box, and plans in it."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from nerfnav.field.storage.checkpoint import save_field
from nerfnav.planner.steps import PlanOutcome
from nerfnav_app.places.ends import End, EndRole
from nerfnav_app.server import App
from nerfnav_app.state.actions import MoveEnd
from nerfnav_app.state.alignment import AlignmentDraft, PickTarget
from tests.browser.tab import Tab
from tests.browser.test_uploads import opening_work
from tests.field.moves import room

FLOOR = ((-0.45, -0.45, 0.0), (0.2, -0.5, 0.0), (-0.2, -0.25, 0.0))


def test_a_place_is_measured_set_on_its_floor_cropped_and_planned_in(
    serve: Callable[..., App], open_tab: Callable[[App], Tab], tmp_path: Path
) -> None:
    save_field(room(), tmp_path / "room.npz")
    app = serve(opening_work())
    tab = open_tab(app)
    tab.turn_to("Scene")
    first = app.session.place
    tab.upload("place.upload", tmp_path / "room.npz")
    tab.until(lambda: app.session.place is not first and app.session.job is None, "the field was not opened")
    tab.until(lambda: tab.has_node("/field"), "the place is not shown")
    tab.unfold("alignment.point")

    def draft() -> AlignmentDraft:
        return app.session.alignment

    def top() -> float | None:
        kept = draft().kept
        return None if kept is None else kept[1][2]

    tab.press("alignment.point", PickTarget.DISTANCE.value)
    for count, point in enumerate(FLOOR[:2], 1):
        tab.until(lambda: draft().pointing is not None, "the page does not wait for a click")
        tab.click_at(point)
        tab.until(lambda n=count: len(draft().measured) == n, "the click told no point")
    assert draft().length == pytest.approx(np.linalg.norm(np.subtract(*FLOOR[:2])), abs=0.08)
    distance = tab.box("alignment.distance")
    tab.until_shown()  # or it would put what was measured over what is typed
    distance.fill(f"{2 * (draft().length or 0):.4f}")
    distance.press("Enter")
    tab.until(lambda: (draft().distance or 0) > 1, "the distance was not taken")

    tab.press("alignment.point", PickTarget.FLOOR.value)
    for count, point in enumerate(FLOOR, 1):
        tab.until(lambda: draft().pointing is not None, "the page does not wait for a click")
        tab.click_at(point)
        tab.until(lambda n=count: len(draft().floor) == n, "the click showed no floor")
    tab.box("alignment.crop").click()
    tab.until(lambda: draft().kept is not None and tab.is_visible("/alignment/kept"), "the box is not shown")
    highest = tab.boxes("alignment.upper").nth(2)
    tab.until_shown()
    highest.fill("0.6")
    highest.press("Enter")
    tab.until(lambda: top() == 0.6, "the box was not taken")

    before, what = app.session.place, app.session.what
    assert before is not None
    tab.press("alignment.apply")
    tab.until(lambda: app.session.what != what and app.session.job is None, "the place was not put right", 240)
    now = app.session.place
    assert now is not None and draft() == AlignmentDraft(undo=(what,), changes=draft().changes) and draft().changes
    sizes = now.field.box.size / before.field.box.size
    assert 1.9 < float(sizes[0]) < 2.2 and 1.4 < float(sizes[2]) < 1.8
    assert abs(float(now.field.box.lower[2]) + 0.2) < 0.15

    for which, position in ((EndRole.START, (-0.5, -0.9, 0.35)), (EndRole.GOAL, (0.3, 0.8, 0.35))):
        app.post(MoveEnd(which, End(position)))
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

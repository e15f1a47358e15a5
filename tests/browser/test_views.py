"""What the page can show of a place, and what can be asked of it by hand, as the browser has it."""

from collections.abc import Callable

import numpy as np
import pytest

from nerfnav_app.jobs.events import JobResult
from nerfnav_app.places.ends import EndRole
from nerfnav_app.queries.density_slice import DensitySliceQuery
from nerfnav_app.queries.field_view import FieldViewQuery
from nerfnav_app.server import App
from nerfnav_app.state.actions import MoveEnd
from nerfnav_app.state.flight import FlightSettings
from nerfnav_app.state.job import JobKind
from nerfnav_app.state.view import Backdrop
from tests.app.doubles import ScriptedWork, flight_step
from tests.browser.tab import Tab
from tests.browser.works import small_work

Serve = Callable[..., App]
OpenTab = Callable[[App], Tab]


POINT = np.array([0.5, 0.4, 0.3])
_EYE = """
() => {
  const mutable = window.__viserMutable, root = mutable.nodeRefFromName[''];
  root.updateWorldMatrix(true, false);
  return root.worldToLocal(mutable.camera.position.clone()).toArray();
}
"""


def rendered(app: App) -> list[FieldViewQuery]:
    """What was rendered for the tabs last."""
    asked = (FieldViewQuery.asked_in(app.session, (FieldViewQuery, client)) for client in app.session.eyes)
    return [query for query in asked if query is not None]


def test_slice_occupied_space_and_surface_are_shown_as_asked(serve: Serve, open_tab: OpenTab) -> None:
    app = serve(small_work())
    tab = open_tab(app)
    tab.unfold("view_settings.camera")
    tab.check("view_settings.sliced")
    tab.until(lambda: tab.is_visible("/slice"), "no slice is shown")
    assert DensitySliceQuery.result_in(app.session) is not None
    place = app.session.place
    assert place is not None
    wide = pytest.approx(float(place.field.box.size[0]))
    tab.until(lambda: tab.property("/slice", "render_width") == wide, "the slice is not as wide as the place")
    tab.check("view_settings.occupied")
    tab.until(lambda: tab.is_visible("/space/occupied"), "occupied space is not shown")
    tab.until(lambda: len(tab.property("/space/occupied", "points")) > 300, "there is little of it")
    tab.check("view_settings.sliced")
    tab.until(lambda: not tab.is_visible("/slice"), "the slice stays")
    tab.choose("view_settings.backdrop", Backdrop.NOTHING.value)
    tab.until(lambda: not tab.is_visible("/field"), "the surface stays")
    tab.load()
    tab.until(
        lambda: not tab.is_visible("/field") and tab.is_visible("/space/occupied"), "a reload has forgotten the view"
    )


def test_the_field_itself_is_rendered_for_each_tab_from_its_own_camera(serve: Serve, open_tab: OpenTab) -> None:
    app = serve(small_work())
    first, second = open_tab(app), open_tab(app)
    first.unfold("view_settings.camera")
    first.choose("view_settings.backdrop", Backdrop.RENDER.value)
    first.until(lambda: len(rendered(app)) == 2, "a tab has no rendering of its own")
    second.page.bring_to_front()
    before = second.settled(lambda: dict(app.session.eyes))
    box = second.page.locator("canvas").first.bounding_box()
    assert box is not None
    x, y = box["x"] + 0.6 * box["width"], box["y"] + 0.8 * box["height"]
    second.page.mouse.move(x, y)
    second.page.mouse.down()
    second.page.mouse.move(x - 120, y, steps=6)
    second.page.mouse.up()
    second.until(lambda: app.session.eyes != before, "nobody looks from anywhere else")
    moved = [client for client, eye in second.settled(lambda: dict(app.session.eyes)).items() if eye != before[client]]
    assert len(moved) == 1, "one person's viewpoint is another's too"
    second.until(
        lambda: all(query.eye == app.session.eyes[query.client] for query in rendered(app)),
        "a rendering stays behind its camera",
    )
    first.page.bring_to_front()
    first.until(lambda: not first.is_visible("/field"), "the surface covers the rendering")


def test_a_click_into_the_scene_puts_an_end_there(serve: Serve, open_tab: OpenTab) -> None:
    app = serve(small_work())
    tab = open_tab(app)
    tab.press("ends.aim", "goal")
    tab.until(lambda: app.session.aiming is EndRole.GOAL, "nothing aims")
    tab.click_at((-0.4, -0.5, 0.38))
    tab.until(lambda: app.session.ends.goal.position[0] < 0, "the goal did not move")
    goal = np.array(app.session.ends.goal.position)
    assert np.linalg.norm(goal[:2] - [-0.4, -0.5]) < 0.15 and 0.3 < goal[2] < 0.6, "it is not on the ball"
    tab.until(lambda: np.allclose(tab.position(EndRole.GOAL), goal, atol=1e-3), "the page has the goal elsewhere")
    tab.click_at((0.5, 0.4, 0.3))
    tab.page.wait_for_timeout(400)
    assert np.allclose(app.session.ends.goal.position, goal), "one click is enough"


def test_an_occupied_end_is_offered_the_nearest_free_place(serve: Serve, open_tab: OpenTab) -> None:
    app = serve(small_work())
    tab = open_tab(app)
    end = app.session.ends.start
    app.post(MoveEnd(EndRole.START, type(end)((0.0, 0.05, 0.3), end.yaw)))
    button = tab.button("ends.offers.start")
    tab.until(button.is_visible, "nothing is offered")
    tab.until(lambda: tab.property("/start/label", "text") == "start: no room", "the handle does not say so")
    button.click()
    tab.until(lambda: app.session.problems.get(EndRole.START, "?") is None, "the robot does not fit there either")
    tab.until(lambda: not button.is_visible(), "the offer stays")


def test_planners_are_drawn_side_by_side(serve: Serve, open_tab: OpenTab) -> None:
    app = serve(small_work())
    tab = open_tab(app)
    tab.press("plan.comparison.compare")
    tab.until(lambda: len(app.session.comparison) >= 2, "no planner has ended", 300)
    tab.press("status.next.cancel")
    tab.until_idle("the comparison goes on")
    for result in app.session.comparison[:2]:
        assert result.motion is not None
        line, points = f"/plan/{result.planner}", result.motion.states.position.numpy()
        tab.until(lambda line=line: tab.is_visible(line), "a planner is not drawn")
        tab.until(lambda line=line, points=points: tab.shows(line, points), "a planner is drawn elsewhere")


def test_weights_and_duration_are_set_in_the_page_and_refused_where_they_make_no_sense(
    serve: Serve, open_tab: OpenTab
) -> None:
    app = serve(small_work())
    tab = open_tab(app)
    tab.unfold("plan.settings.weights.collision")
    tab.box("plan.settings.weights.collision").fill("5")
    tab.box("plan.settings.duration").fill("3")
    tab.until(lambda: app.session.plan_settings.weights.collision == 5.0, "the weight was not taken")
    tab.until(lambda: app.session.plan_settings.duration_s == 3.0, "the duration was not taken")
    tab.box("plan.settings.weights.collision").fill("-7")
    tab.until(lambda: tab.says("Collision must be from 0 to 1e+06"), "nobody complains")
    assert app.session.plan_settings.weights.collision == 5.0


def test_a_flight_is_slowed_pushed_and_charted(serve: Serve, open_tab: OpenTab) -> None:
    steps = [lambda job, k=k: flight_step(job.ends, k) for k in range(2000)]
    app = serve(ScriptedWork({JobKind.FLY: [*steps, JobResult()]}))
    tab = open_tab(app)
    tab.unfold("flight.settings.speed")
    tab.choose("flight.settings.speed", "real time")
    tab.until(lambda: app.session.flight_settings == FlightSettings(pace=1.0), "the speed was not taken")
    tab.key("f")
    tab.until(lambda: app.session.steps_reported > 3, "it does not fly")
    tab.press("flight.gust")
    tab.until(lambda: app.session.job is not None and app.session.job.gusts == 1, "no gust blows")
    tab.until(lambda: tab.page.locator(".uplot").locator("visible=true").count() == 1, "there is no chart")
    tab.until(lambda: tab.is_visible("/flight/attitude"), "the attitude's uncertainty is not drawn")
    tab.press("status.next.cancel")
    tab.until(lambda: app.session.job is None, "it flies on")
    assert app.session.steps_reported < 2000


def is_told(tab: Tab) -> bool:
    """Whether the session knows where the page's camera is."""
    viewed = tab.app.session.viewed
    return viewed is not None and np.allclose(tab.page.evaluate(_EYE), viewed[0], atol=1e-3)


def test_the_camera_is_where_it_was_left_when_the_server_is_started_again(serve: Serve, open_tab: OpenTab) -> None:
    app = serve(small_work(), remembers=True)
    tab = open_tab(app)
    x, y = first = tab.resting(POINT)
    tab.page.mouse.move(x - 100, y + 60)
    for _ in range(3):
        tab.page.mouse.wheel(0, -300)
    tab.until(lambda: np.abs(np.subtract(tab.on_screen(POINT), first)).max() > 10, "the camera cannot be moved")
    left = tab.resting(POINT)
    tab.until(lambda: is_told(tab), "nobody was told where the camera is")
    app.stop()
    again = serve(small_work(), remembers=True)
    tab = open_tab(again)
    assert again.session.view == app.session.viewed
    tab.until(lambda: np.abs(np.subtract(tab.on_screen(POINT), left)).max() < 3, "the camera is elsewhere")

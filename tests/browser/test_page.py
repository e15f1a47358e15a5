"""The page as a user has it: what is shown, what can be dragged and pressed, what survives."""

import math
import time
import urllib.error
import urllib.request
from collections.abc import Callable

import numpy as np
import pytest
from playwright.sync_api import BrowserContext

from nerfnav.core.errors import NerfnavError
from nerfnav.planner.steps import PlanOutcome
from nerfnav_app.jobs.events import JobResult, Progress
from nerfnav_app.page.layers.ends import GIZMO
from nerfnav_app.page.panels.plan.plan import describe_outcome
from nerfnav_app.places.ends import EndRole
from nerfnav_app.server import App
from nerfnav_app.state.job import JobKind
from tests.app.doubles import ScriptedWork, flight_step, plan_step
from tests.browser.tab import Tab

Serve = Callable[..., App]
OpenTab = Callable[[App], Tab]


_SURROUNDINGS = """
() => {
  let scene = window.__viserMutable.nodeRefFromName[''];
  while (scene.parent) scene = scene.parent;
  return scene.environment ? 'a picture of them' : null;
}
"""


def endless(job: object) -> Progress:
    """A step of a job that never gets anywhere."""
    time.sleep(0.02)
    return Progress("optimising", 0.5)


def test_the_page_shows_handles_and_panel_under_its_own_name(serve: Serve, open_tab: OpenTab) -> None:
    tab = open_tab(serve(ScriptedWork()))
    assert tab.page.title() == "nerfnav"
    tab.until(lambda: tab.says("balls"), "the place has no name")
    assert tab.button("status.next.start_plan").is_enabled()
    assert tab.button("status.reset").is_enabled()
    assert tab.button("status.undo").is_disabled() and tab.button("status.redo").is_disabled(), "there is nothing yet"
    for which in EndRole:
        np.testing.assert_allclose(tab.position(which), tab.app.session.ends.of(which).position, atol=1e-5)
    assert tab.has_node("/sky") and tab.page.evaluate(_SURROUNDINGS) is None, "the light comes from lamps alone"


def test_dragging_an_arrow_moves_the_end_in_every_tab_and_stays_after_a_reload(serve: Serve, open_tab: OpenTab) -> None:
    app = serve(ScriptedWork())
    first, second = open_tab(app), open_tab(app)
    before = np.array(app.session.ends.goal.position)
    first.page.bring_to_front()
    first.drag_along_x(EndRole.GOAL, -0.3, GIZMO)
    moved = np.array(app.session.ends.goal.position)
    np.testing.assert_allclose(moved - before, [-0.3, 0, 0], atol=0.05)
    for tab in (first, second):
        tab.page.bring_to_front()
        tab.until(lambda tab=tab: np.allclose(tab.position(EndRole.GOAL), moved, atol=1e-3), "a tab lags behind")
    first.load()
    first.until(lambda: np.allclose(first.position(EndRole.GOAL), moved, atol=1e-3), "the reload has lost the goal")


def test_an_end_dragged_out_of_the_box_comes_back_to_its_border(serve: Serve, open_tab: OpenTab) -> None:
    tab = open_tab(serve(ScriptedWork()))
    tab.drag_along_x(EndRole.START, -0.6, GIZMO)
    place = tab.app.session.place
    assert place is not None
    border = -1 + place.robot.body.radius
    tab.until(lambda: math.isclose(tab.position(EndRole.START)[0], border, abs_tol=1e-3), "the gizmo stayed outside")
    assert tab.app.session.ends.start.position[0] == pytest.approx(border, abs=1e-4)


def test_a_tab_that_sends_nonsense_harms_nobody(serve: Serve, open_tab: OpenTab) -> None:
    tab = open_tab(serve(ScriptedWork()))
    for count, position in enumerate(("[NaN, 0, 0.4]", "[1e30, 0, 0.4]", "[0.1, 0.2]", "[]")):
        tab.page.evaluate(
            "window.__viserMutable.sendMessage({type: 'TransformControlsUpdateMessage', name: '/goal', owner: '',"
            f" wxyz: [1, 0, 0, 0], position: {position}}})"
        )
        tab.page.evaluate(
            "window.__viserMutable.sendMessage({type: 'TransformControlsDragEndMessage', name: '/goal', owner: ''})"
        )
        tab.page.wait_for_timeout(300)  # to do harm in
        tab.drag_along_x(EndRole.START, 0.2 if count % 2 == 0 else -0.2, GIZMO)
        place = tab.app.session.place
        assert place is not None
        for which in EndRole:
            assert place.field.box.contains(tab.app.session.ends.of(which).state().position)
        tab.until_ends_agree()


def test_typed_numbers_move_the_gizmo(serve: Serve, open_tab: OpenTab) -> None:
    tab = open_tab(serve(ScriptedWork()))
    box = tab.boxes("ends.numbers.goal.position").nth(2)
    box.fill("0.5")
    box.press("Enter")
    tab.until(lambda: math.isclose(tab.position(EndRole.GOAL)[2], 0.5, abs_tol=1e-4), "the gizmo did not follow")


def test_the_plan_in_both_tabs_ends_at_the_dragged_goal(serve: Serve, open_tab: OpenTab) -> None:
    steps = [lambda job, k=k: plan_step(job.ends, k) for k in range(20)]
    last = [lambda job: plan_step(job.ends, 20, PlanOutcome.CONVERGED), JobResult({"wall_s": 0.1})]
    app = serve(ScriptedWork({JobKind.PLAN: [*steps, *last]}))
    first, second = open_tab(app), open_tab(app)
    first.page.bring_to_front()
    first.drag_along_x(EndRole.GOAL, -0.2, GIZMO)
    first.press("status.next.start_plan")
    first.until(lambda: app.session.plan is not None and app.session.job is None, "the plan did not end")
    for tab in (first, second):
        tab.page.bring_to_front()
        tab.until(lambda tab=tab: tab.is_visible("/plan/line"), "no plan is shown")
        goal = app.session.ends.goal.position
        tab.until(
            lambda tab=tab, goal=goal: np.allclose(tab.line("/plan/line")[-1], goal, atol=1e-4), "it ends elsewhere"
        )
    first.turn_to("Plan")
    first.until(lambda: first.says(describe_outcome(PlanOutcome.CONVERGED)), "the page does not say how it ended")


def test_a_plan_turns_grey_when_an_end_moves(serve: Serve, open_tab: OpenTab) -> None:
    done = [lambda job: plan_step(job.ends, 0, PlanOutcome.CONVERGED), JobResult()]
    tab = open_tab(serve(ScriptedWork({JobKind.PLAN: done})))
    tab.press("status.next.start_plan")
    tab.until(lambda: tab.is_visible("/plan/line"), "no plan is shown")
    fresh = tab.property("/plan/line", "colors")
    tab.drag_along_x(EndRole.GOAL, -0.2, GIZMO)
    tab.until(lambda: tab.property("/plan/line", "colors") != fresh, "a stale plan looks fresh")
    tab.turn_to("Plan")
    tab.until(lambda: tab.says("have changed since this plan"), "the page does not say that it is stale")


def test_cancel_stops_a_plan_and_the_next_one_can_begin(serve: Serve, open_tab: OpenTab) -> None:
    tab = open_tab(serve(ScriptedWork({JobKind.PLAN: [lambda job: plan_step(job.ends, 0), *[endless] * 5000]})))
    tab.press("status.next.start_plan")
    tab.until(lambda: tab.says("Optimising 50 %"), "no progress is shown")
    tab.press("status.next.cancel")
    tab.until(lambda: tab.app.session.job is None, "the plan went on")
    tab.turn_to("Plan")
    tab.until(lambda: tab.says("Stopped before it was finished."), "the page does not say that it stopped")
    tab.until(lambda: tab.is_visible("/plan/line"), "what was planned is gone")
    tab.press("status.next.start_plan")
    tab.until(lambda: tab.app.session.job is not None, "no second plan began")


def test_a_failed_job_is_told_and_the_app_goes_on(serve: Serve, open_tab: OpenTab) -> None:
    work = ScriptedWork({JobKind.PLAN: [NerfnavError("the goal is inside a stone")]})
    app = serve(work)
    tab = open_tab(app)
    tab.press("status.next.start_plan")
    tab.until(lambda: tab.says("Could not plan: the goal is inside a stone"), "nobody says why")
    assert tab.page.locator(".mantine-Notification-root", has_text="inside a stone").count() == 0, "it is said twice"
    work.scripts[JobKind.PLAN] = [lambda job: plan_step(job.ends, 0, PlanOutcome.CONVERGED), JobResult()]
    tab.press("status.next.start_plan")
    tab.until(lambda: tab.is_visible("/plan/line"), "the app did not go on")
    tab.until(lambda: not tab.says("inside a stone"), "the error has outlived its cause")


def test_a_flight_can_be_paused_stepped_and_stopped(serve: Serve, open_tab: OpenTab) -> None:
    def slowly(index: int) -> Callable[[object], object]:
        def step(job: object) -> object:
            endless(job)
            return flight_step(job.ends, index)  # type: ignore[attr-defined]

        return step

    tab = open_tab(serve(ScriptedWork({JobKind.FLY: [slowly(k) for k in range(2000)]})))
    app = tab.app
    tab.key("f")
    tab.until(lambda: app.session.steps_reported > 3, "the flight did not begin")
    tab.press("flight.steer", "Pause")
    tab.until(lambda: tab.says("Paused after time step"), "the flight was not paused")
    held = tab.settled(lambda: app.session.steps_reported)  # the step in progress is taken to its end
    tab.press("flight.steer", "Step")
    tab.until(lambda: app.session.steps_reported == held + 1, "no step was taken")
    tab.page.wait_for_timeout(300)
    assert app.session.steps_reported == held + 1
    tab.until(lambda: len(tab.line("/flight/truth")) == held + 1, "the path does not show the step")

    def centers() -> np.ndarray:
        return np.array(tab.property("/flight/covariance", "batched_positions")).reshape(-1, 3)

    tab.until(lambda: len(centers()) == held + 1, "the covariances do not show the step")
    half = np.array(tab.property("/flight/covariance", "batched_scales")).reshape(-1, 3)
    np.testing.assert_allclose(half.max(-1), 2.7955 * 0.02, rtol=1e-3)
    tab.press("flight.steer", "Resume")
    tab.until(lambda: app.session.steps_reported > held + 3, "the flight did not go on")
    tab.press("status.next.cancel")
    tab.until(lambda: app.session.job is None, "the flight was not stopped")
    tab.until(lambda: tab.says("Stopped before the goal."), "the page does not say that it stopped")


def test_without_the_token_there_is_no_page(serve: Serve, context: BrowserContext) -> None:
    app = serve(ScriptedWork(), token="secret-1")
    bare = app.url.split("?")[0]
    for url in (bare, f"{bare}?token=wrong"):
        with pytest.raises(urllib.error.HTTPError, match="403"):
            urllib.request.urlopen(url)
    tab = Tab(context.new_page(), app)
    tab.load()
    tab.until(lambda: tab.says("balls"), "the place has no name")


@pytest.mark.parametrize("headers", [{"Host": "evil.example"}, {"Origin": "http://evil.example"}])
def test_other_sites_are_refused(serve: Serve, headers: dict[str, str]) -> None:
    app = serve(ScriptedWork())
    assert urllib.request.urlopen(app.url).status == 200
    with pytest.raises(urllib.error.HTTPError, match="403"):
        urllib.request.urlopen(urllib.request.Request(app.url, headers=headers))

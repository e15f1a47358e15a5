"""Everything by keyboard, one session in many tabs, and a viewpoint of one's own."""

import re
import time
from collections.abc import Callable

import numpy as np
from playwright.sync_api import Locator

from nerfnav.planner.steps import PlanOutcome
from nerfnav_app.jobs.events import JobResult, Progress
from nerfnav_app.page.layers.ends import GIZMO
from nerfnav_app.places.ends import EndRole
from nerfnav_app.server import App
from nerfnav_app.state.job import JobKind
from tests.app.doubles import ScriptedWork, flight_step, plan_step
from tests.browser.tab import Tab

Serve = Callable[..., App]
OpenTab = Callable[[App], Tab]

_EYE = "() => Array.from(window.__viserMutable.camera.position)"


def work() -> ScriptedWork:
    """A plan that is made at once, and a flight that takes a while."""

    def step(index: int) -> Callable[[object], object]:
        def make(job: object) -> object:
            time.sleep(0.05)
            return flight_step(job.ends, index)  # type: ignore[attr-defined]

        return make

    planned = [lambda job: plan_step(job.ends, 0, PlanOutcome.CONVERGED), JobResult()]
    return ScriptedWork({JobKind.PLAN: planned, JobKind.FLY: [step(k) for k in range(2000)]})


def command(tab: Tab, name: str) -> None:
    """Choose a command of the palette as a person does."""
    open_palette(tab).fill(name)
    tab.page.locator(".mantine-Spotlight-actionLabel").filter(has_text=re.compile(f"^{name}$")).click()
    is_closed(tab)


def is_closed(tab: Tab) -> None:
    """Wait until the palette has gone."""
    tab.until(lambda: not tab.page.locator(".mantine-Spotlight-search").count(), "the palette stays open")


def open_palette(tab: Tab) -> Locator:
    """Open the palette; its box for words, empty."""
    tab.until_shown()
    tab.page.keyboard.press("Control+k")
    box = tab.page.get_by_placeholder("Search commands")
    box.wait_for()
    box.fill("")
    return box


def test_the_palette_shows_commands_with_their_shortcuts_and_does_what_the_buttons_do(
    serve: Serve, open_tab: OpenTab
) -> None:
    app = serve(work())
    tab = open_tab(app)
    open_palette(tab)
    for words in ("Plan", "Fly", "Next task", "Open church", "Planner: rrt", "Robot: couch"):
        tab.page.locator(".mantine-Spotlight-action", has_text=words).first.wait_for()
    tab.page.keyboard.press("Escape")
    is_closed(tab)
    command(tab, "Planner: paper")
    tab.until(lambda: app.session.choice.planner == "paper", "the planner was not chosen")
    command(tab, "Plan")
    tab.until(lambda: tab.is_visible("/plan/line"), "no plan was made")
    tab.until_idle()


def test_the_palette_opens_a_file_turns_to_the_exports_and_writes_keys_as_words(
    serve: Serve, open_tab: OpenTab
) -> None:
    tab = open_tab(serve(work()))
    tab.turn_to("Plan")
    open_palette(tab)
    keys = tab.page.locator(".mantine-Spotlight-actionDescription")
    tab.until(lambda: {"Page Up", "Page Down", "Space"} <= set(keys.all_text_contents()), "keys are no words")
    tab.page.keyboard.press("Escape")
    is_closed(tab)
    chosen = tab.page.locator("[role=tab][aria-selected=true]")
    with tab.page.expect_file_chooser():
        command(tab, "Open a file")
    tab.until(lambda: (chosen.text_content() or "").endswith("Scene"), "the tab is not turned to")
    command(tab, "Export")
    tab.until(lambda: (chosen.text_content() or "").endswith("Export"), "the exports are not shown")
    with tab.page.expect_download():
        command(tab, "Screenshot")


def test_a_reset_asks_first(serve: Serve, open_tab: OpenTab) -> None:
    app = serve(work())
    tab = open_tab(app)
    tab.key("p")
    tab.until(lambda: app.session.fresh_plan is not None, "no plan was made")
    for answer, plan_stays in (("Keep all", True), ("Reset all", False)):
        tab.key("Shift+r")
        button = tab.page.get_by_role("button", name=answer, exact=True)
        button.click()
        button.wait_for(state="hidden")
        tab.until(lambda plan_stays=plan_stays: (app.session.plan is not None) == plan_stays, "the answer is not heard")


def test_shortcuts_fly_hold_and_stop_and_are_letters_where_text_is_typed(serve: Serve, open_tab: OpenTab) -> None:
    app = serve(work())
    tab = open_tab(app)
    tab.turn_to("Scene")
    box = tab.boxes("ends.numbers.goal.position").nth(2)
    box.click()
    tab.page.keyboard.press("f")
    tab.page.wait_for_timeout(300)
    assert app.session.job is None, "a letter typed into a box has begun a flight"
    tab.page.keyboard.press("Escape")
    tab.key("f")
    tab.until(lambda: app.session.steps_reported > 2, "F does not fly")
    tab.key("Space")
    tab.until(lambda: app.session.job is not None and app.session.job.paused, "space does not hold")
    held = tab.settled(lambda: app.session.steps_reported)  # the step in progress is taken to its end
    tab.key("s")
    tab.until(lambda: app.session.steps_reported == held + 1, "S takes no step")
    tab.key("Space")
    tab.until(lambda: app.session.steps_reported > held + 3, "space does not go on")
    tab.key("x")
    tab.until(lambda: app.session.job is None, "X does not stop")


def test_a_reload_keeps_everything_and_every_tab_shows_it(serve: Serve, open_tab: OpenTab) -> None:
    app = serve(work())
    first, second = open_tab(app), open_tab(app)
    first.page.bring_to_front()
    first.drag_along_x(EndRole.GOAL, -0.2, GIZMO)
    command(first, "Plan")
    first.until(lambda: first.is_visible("/plan/line"), "no plan is shown")
    seen = first.line("/plan/line")
    goal = app.session.ends.goal.position
    for tab in (first, second):
        tab.page.bring_to_front()
        tab.load()
        tab.until(lambda tab=tab: tab.is_visible("/plan/line"), "a reload has lost the plan")
        tab.until(lambda tab=tab: np.array_equal(tab.line("/plan/line"), seen), "a reload has changed the plan")
        tab.until(lambda tab=tab: np.allclose(tab.position(EndRole.GOAL), goal, atol=1e-4), "the goal is elsewhere")


def test_one_persons_viewpoint_is_their_own(serve: Serve, open_tab: OpenTab) -> None:
    app = serve(work())
    first, second = open_tab(app), open_tab(app)
    second.page.bring_to_front()
    before = np.array(second.settled(lambda: second.page.evaluate(_EYE)))
    first.page.bring_to_front()
    own = np.array(first.page.evaluate(_EYE))
    mouse = first.page.mouse
    mouse.move(400, 300)
    mouse.down()
    mouse.move(560, 260, steps=8)
    mouse.up()
    first.until(lambda: np.linalg.norm(np.array(first.page.evaluate(_EYE)) - own) > 0.1, "the view did not turn")
    second.page.bring_to_front()
    second.page.wait_for_timeout(500)
    np.testing.assert_allclose(np.array(second.page.evaluate(_EYE)), before, atol=1e-3)


def test_a_command_that_cannot_be_done_now_is_greyed_out(serve: Serve, open_tab: OpenTab) -> None:
    steps = [lambda job: time.sleep(0.02) or Progress("optimising", 0.5)] * 5000
    app = serve(ScriptedWork({JobKind.PLAN: steps}))
    tab = open_tab(app)
    disabled = tab.page.locator(".mantine-Spotlight-action[style*='not-allowed']")
    open_palette(tab)
    tab.until(lambda: disabled.filter(has_text="Gust").count() == 1, "a gust can be asked for where nobody flies")
    tab.until(lambda: disabled.filter(has_text="Fly").count() == 0, "no flight can be asked for where nothing runs")
    tab.page.keyboard.press("Escape")
    is_closed(tab)
    command(tab, "Plan")
    tab.until(lambda: app.session.job is not None, "no plan began")
    open_palette(tab)
    tab.until(lambda: disabled.filter(has_text="Fly").count() == 1, "a flight can be asked for while planning")

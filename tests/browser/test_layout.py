"""What covers what: no panel covers start, goal or plan, at the sizes of a screen, a laptop, a window and a phone."""

from collections.abc import Callable

import numpy as np
import pytest
from playwright.sync_api import Browser

from app.places.ends import Which
from app.server import App
from tests.browser.tab import Tab, to_screen
from tests.browser.works import small_work

Serve = Callable[..., App]
OpenTab = Callable[[App], Tab]

SIZES = ((1400, 850), (1280, 720), (1000, 640), (420, 850))
_LEAST_SHARE = 0.6  # of the page that the scene has
# rectangles that are drawn over the scene's canvas: docked and floating panels, the sheet of a phone
_PANELS = """
() => ['[data-dock-region]', '[data-floating-window]', 'div:has(> .mantine-Notifications-root) > .mantine-Paper-root']
  .flatMap(kind => [...document.querySelectorAll(kind)]).map(e => e.getBoundingClientRect())
  .map(r => [r.left, r.top, r.right, r.bottom])
"""
_CANVAS = """
() => { const r = window.__viserMutable.canvas.getBoundingClientRect(); return [r.left, r.top, r.right, r.bottom]; }
"""


@pytest.fixture
def tab(serve: Serve, open_tab: OpenTab) -> Tab:
    """A tab with a plan."""
    app = serve(small_work())
    tab = open_tab(app)
    tab.press("Plan the way")
    tab.until(lambda: app.session.fresh_plan is not None and app.session.job is None, "no plan was found")
    tab.until(lambda: tab.is_visible("/plan/line"), "the plan is not drawn")
    return tab


@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size[0]}x{size[1]}")
def test_no_panel_covers_start_goal_or_plan(tab: Tab, size: tuple[int, int]) -> None:
    width, height = size
    tab.page.set_viewport_size({"width": width, "height": height})
    tab.until(lambda: tab.page.get_by_role("tab", name="Scene").first.is_visible(), "the panel is not there")
    left, top, right, bottom = tab.settled(lambda: tab.page.evaluate(_CANVAS))
    assert (right - left) * (bottom - top) >= _LEAST_SHARE * width * height
    points = np.concatenate([[tab.position(which) for which in Which], tab.line("/plan/line")])
    panels = tab.page.evaluate(_PANELS)
    assert panels, "no panel was found: the test looks for the wrong names"
    for point in points:
        x, y = to_screen(tab.page, point)
        assert left <= x <= right and top <= y <= bottom, f"{point} is not in sight"
        assert not any(x0 < x < x1 and y0 < y < y1 for x0, y0, x1, y1 in panels), f"a panel covers {point}"


def test_the_pictures_fold_away_and_open_large(tab: Tab) -> None:
    strip = tab.page.locator("img[src^=blob]").first
    tab.until(strip.is_visible, "there are no pictures")
    slim = strip.bounding_box()
    assert slim is not None and slim["height"] < 100
    strip.hover()
    tab.page.locator("div:has(> img[src^=blob]) > button").click()
    large = tab.page.locator(".mantine-Modal-body img")
    tab.until(lambda: (large.bounding_box() or slim)["height"] > 2.5 * slim["height"], "they do not open large")
    tab.page.keyboard.press("Escape")
    large.wait_for(state="hidden")
    tab.page.get_by_text("Camera", exact=True).click()
    tab.until(lambda: not strip.is_visible() or (strip.bounding_box() or slim)["height"] < 2, "they do not fold away")


def test_the_plan_is_drawn_through_what_hides_it(tab: Tab) -> None:
    depth_tested = """
    () => { const tested = [];
      window.__viserMutable.nodeRefFromName['/plan/line/through'].traverse(
        part => part.material && tested.push(part.material.depthTest));
      return tested; }
    """
    tab.until(lambda: tab.page.evaluate(depth_tested) == [False, False], "the line is hidden by walls")
    np.testing.assert_allclose(tab.line("/plan/line/through"), tab.line("/plan/line"))


def test_help_opens_at_first_sight_and_by_its_key(serve: Serve, browser: Browser) -> None:
    app = serve(small_work())
    context = browser.new_context(viewport={"width": 1000, "height": 640})
    page = context.new_page()
    dialog = page.get_by_role("dialog", name="Help")
    for first in (True, False):
        page.goto(f"{app.url}?fixedDpr=0.5")
        page.wait_for_function("window.__viserMutable && window.__viserMutable.canvas")
        if first:  # it may come a moment after the scene on a busy machine
            dialog.wait_for()
            page.get_by_role("button", name="Begin").click()
        else:
            page.wait_for_timeout(2000)
            assert not dialog.is_visible()
    page.keyboard.press("?")
    dialog.wait_for()
    page.keyboard.press("Escape")
    dialog.wait_for(state="hidden")
    context.close()

"""What covers what: no panel covers start, goal or plan, at the sizes of a screen, a laptop, a window and a phone."""

from collections.abc import Callable

import numpy as np
import pytest
from playwright.sync_api import Browser, BrowserContext

from nerfnav_app.places.ends import EndRole
from nerfnav_app.server import App
from tests.browser.in_page import to_screen
from tests.browser.tab import KNOWS_HELP, WITHOUT_COMPLAINT, Tab
from tests.browser.works import small_work
from tests.waiting import PATIENCE_S

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
    tab.press("status.next.start_plan")
    tab.until_planned()
    tab.until(lambda: tab.is_visible("/plan/line"), "the plan is not drawn")
    return tab


def hidden(tab: Tab, points: np.ndarray) -> str:
    """What is wrong with where some points (n, 3) of the world are on the page now; empty where nothing is."""
    left, top, right, bottom = tab.page.evaluate(_CANVAS)
    panels = tab.page.evaluate(_PANELS)
    if not panels:
        return "no panel was found: the test looks for the wrong names"
    for point in points:
        x, y = to_screen(tab.page, point)
        if not (left <= x <= right and top <= y <= bottom):
            return f"{point} is not in sight"
        if any(x0 < x < x1 and y0 < y < y1 for x0, y0, x1, y1 in panels):
            return f"a panel covers {point}"
    return ""


def test_no_panel_covers_start_goal_or_plan(tab: Tab) -> None:
    for width, height in SIZES:
        tab.page.set_viewport_size({"width": width, "height": height})
        tab.until(lambda: tab.page.get_by_role("tab", name="Scene").first.is_visible(), "the panel is not there")
        tab.until(lambda size=(width, height): _LEAST_SHARE <= share(tab, size) <= 1, "the panels take too much")
        points = np.concatenate([[tab.position(which) for which in EndRole], tab.line("/plan/line")])
        assert len(points) > 10
        if width > 600:  # on a phone there is a menu of them
            tab.until(lambda width=width: end_of_tabs(tab) <= width, "a tab is cut off")
        wrong = tab.settled(lambda points=points: hidden(tab, points))
        assert not wrong, f"{width} x {height}: {wrong}"


def share(tab: Tab, size: tuple[int, int]) -> float:
    """Share of the scene in a page of this size."""
    left, top, right, bottom = tab.page.evaluate(_CANVAS)
    return (right - left) * (bottom - top) / (size[0] * size[1])


def end_of_tabs(tab: Tab) -> float:
    """Right border of the last tab [pixels]; infinite where it is not shown."""
    box = tab.page.get_by_role("tab", name="Export", exact=True).bounding_box()
    return np.inf if box is None else box["x"] + box["width"]


def test_the_panel_is_as_wide_after_a_visit_to_the_width_of_a_phone(tab: Tab) -> None:
    tab.turn_to("Runs")
    wide = "() => document.querySelector('[data-dock-region]')?.getBoundingClientRect().width"
    before = tab.page.evaluate(wide)
    for width in (420, 640, 1280):
        tab.page.set_viewport_size({"width": width, "height": 720})
        tab.until(lambda width=width: (tab.page.evaluate(wide) is None) == (width == 420), "the panel is not there")
    tab.settled(lambda: tab.page.evaluate(wide))
    assert tab.page.evaluate(wide) == before
    last, region = tab.page.get_by_role("tab", name="Export", exact=True), tab.page.locator("[data-dock-region]")
    end, border = last.bounding_box(), region.bounding_box()
    assert end is not None and border is not None
    assert end["x"] + end["width"] <= border["x"] + border["width"], "the last tab is cut off"


def test_a_folded_section_is_a_line_without_a_frame(tab: Tab) -> None:
    tab.turn_to("Scene")
    folder = tab.page.locator(".mantine-Paper-root:has(> .mantine-Paper-root)", has_text="Place library").last
    frame = "e => [e.getBoundingClientRect().height, getComputedStyle(e).borderTopColor]"
    height, color = folder.evaluate(frame)
    assert height < 40 and color == "rgba(0, 0, 0, 0)"
    tab.unfold("place_library.list")
    tab.until(lambda: folder.evaluate(frame)[1] != "rgba(0, 0, 0, 0)", "what is open has no frame")


def test_the_pictures_fold_away_and_open_large(tab: Tab) -> None:
    strip = tab.page.locator("img[src^=blob]").first
    tab.until(strip.is_visible, "there are no pictures")
    tab.until(lambda: (strip.bounding_box() or {"height": 0})["height"] > 0, "the pictures have no height")
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
      window.__viserMutable.nodeRefFromName['/plan/line/through']?.traverse(
        part => part.material && tested.push(part.material.depthTest));
      return tested; }
    """
    tab.until(lambda: tab.page.evaluate(depth_tested) == [False, False], "the line is hidden by walls")
    assert tab.shows("/plan/line/through", tab.line("/plan/line")), "what is seen through walls is another line"


def test_help_opens_at_first_sight_and_by_its_key(serve: Serve, browser: Browser) -> None:
    app = serve(small_work())
    context = browser.new_context(viewport={"width": 1000, "height": 640})
    context.set_default_timeout(1000 * PATIENCE_S)
    page = context.new_page()
    dialog = page.get_by_role("dialog", name="Help")
    for first in (True, False):
        page.goto(f"{app.url}?fixedDpr=0.5")
        page.wait_for_function("window.__viserMutable && window.__viserMutable.canvas")
        if first:  # it may come a moment after the scene on a busy machine
            dialog.wait_for()
            page.get_by_role("button", name="Begin").click()
            page.wait_for_function("localStorage.getItem('nerfnav-help-seen')")
        else:
            page.wait_for_timeout(2000)
            assert not dialog.is_visible()
    page.keyboard.press("?")
    dialog.wait_for()
    page.keyboard.press("Escape")
    dialog.wait_for(state="hidden")
    context.close()


def _plain_context(browser: Browser) -> BrowserContext:
    """A small page whose pixels, frames and complaints are its test's own matter."""
    context = browser.new_context(viewport={"width": 500, "height": 400})
    context.set_default_timeout(1000 * PATIENCE_S)
    context.add_init_script(KNOWS_HELP)
    context.add_init_script(WITHOUT_COMPLAINT)
    return context


def test_where_a_page_is_drawn_in_software_edges_are_rough_and_a_drag_is_drawn_with_fewer_pixels(
    serve: Serve, browser: Browser
) -> None:
    app, context = serve(small_work()), _plain_context(browser)
    store = "window.__viserMutable.scene?.__r3f?.root"
    smooth = "window.__viserMutable.canvas.getContext('webgl2').getContextAttributes().antialias"
    width = "window.__viserMutable.canvas.width"
    page = context.new_page()
    for query, antialiased in (("?fixedDpr=1", True), ("", False)):
        page.goto(f"{app.url}{query}")
        page.wait_for_function("window.__viserMutable?.canvas && window.__viserMutable.camera")
        assert page.evaluate(smooth) is antialiased
    # viser itself draws down to three quarters of the pixels' width where frames are slow
    page.wait_for_function(f"{width} >= 375 && !!{store}")
    page.wait_for_function("document.elementFromPoint(60, 120) === window.__viserMutable.canvas")
    page.mouse.move(60, 120)
    page.mouse.down()
    page.wait_for_function(f"{width} === 250")
    page.evaluate(f"{store}.getState().setDpr(0.8)")
    assert page.evaluate(width) == 250, "viser's ratio counts while the pointer still holds"
    page.mouse.up()
    page.wait_for_function(f"{width} >= 375")
    context.close()


def test_where_a_page_is_drawn_in_software_frames_are_spaced_unless_a_hand_moves_something(
    serve: Serve, browser: Browser
) -> None:
    app, context = serve(small_work()), _plain_context(browser)
    gaps = """count => new Promise(done => {
      const at = [], frame = () => {
        at.push(performance.now());
        if (at.length > count) done(at.slice(1).map((time, index) => time - at[index]));
        else requestAnimationFrame(frame);
      };
      requestAnimationFrame(frame);
    })"""
    page = context.new_page()
    for query, spaced in (("?fixedDpr=1", False), ("?fixedDpr=0.5", True), ("", True)):
        page.goto(f"{app.url}{query}")
        page.wait_for_function("document.elementFromPoint(60, 120) === window.__viserMutable?.canvas")
        assert (min(page.evaluate(gaps, 30)) > 40) is spaced
    page.mouse.move(60, 120)
    page.mouse.down()
    assert min(page.evaluate(gaps, 30)) < 40
    page.mouse.up()
    page.wait_for_timeout(1000)
    assert min(page.evaluate(gaps, 30)) > 40
    assert page.evaluate("""() => new Promise(done => {
      const taken = requestAnimationFrame(() => done(false));
      cancelAnimationFrame(taken);
      requestAnimationFrame(() => done(true));
    })"""), "a request that was taken back is not answered"
    context.close()

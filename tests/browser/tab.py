"""What a person does with the page, and what the page's own state says."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import Locator, Page

from nerfnav_app.places.ends import EndRole
from nerfnav_app.server import App
from nerfnav_app.state.session import Session
from tests.app.page.handles import named_handles, position_of
from tests.browser.in_page import DRAWN, IS_SCENE, POSITION, PROPERTY, VISIBLE, to_screen
from tests.browser.shown import Shown
from tests.waiting import PATIENCE_S

WITHOUT_COMPLAINT = """
new MutationObserver(() => {
  for (const told of document.querySelectorAll('.mantine-Notification-root'))
    if (told.textContent.includes('WebGL')) told.style.display = 'none';
}).observe(document, {childList: true, subtree: true});
"""
"""Hides viser's complaint about drawing without a graphics card, which would cover the scene."""
FEW_FRAMES = """
(() => {
  const draw = window.requestAnimationFrame.bind(window);
  window.requestAnimationFrame = callback => setTimeout(() => draw(callback), 100);
  window.cancelAnimationFrame = clearTimeout.bind(window);
})();
"""
"""Spaces frames by 100 ms more than the page does (software_gl.js), also in a hand: they are drawn on the cores that
the tests need."""
KNOWS_HELP = "localStorage.setItem('nerfnav-help-seen', '1')"
"""Script of a browser that was here before: help does not come by itself, and does not cover the page."""


class Tab:
    """One open page of an app."""

    def __init__(self, page: Page, app: App) -> None:
        self.page, self.app = page, app
        page.set_default_timeout(1000 * PATIENCE_S)
        page.add_init_script(KNOWS_HELP)
        page.add_init_script(WITHOUT_COMPLAINT)
        page.add_init_script(FEW_FRAMES)

    def load(self) -> None:
        """Load the page, and wait until its place can be used."""
        separator = "&" if "?" in self.app.url else "?"
        self.page.goto(f"{self.app.url}{separator}fixedDpr=0.5")
        self.page.wait_for_function("window.__viserSceneTree && window.__viserMutable && window.__viserMutable.canvas")
        self.until_idle()
        self.until(lambda: not self.app.session.seeking, "no ends were found")
        self.until(lambda: self.has_node("/start") and self.has_node("/goal"), "the ends were not shown")
        self.until_ends_agree()
        self.until_shown()

    @property
    def shown(self) -> Shown:
        """What pages of the app were told."""
        return next(part for part in self.app._loop.parts if isinstance(part, Shown))

    def until(self, condition: Callable[[], Any], complaint: str, timeout_s: float = PATIENCE_S) -> None:
        """Wait until `condition` holds, letting the page live meanwhile."""
        end = time.monotonic() + timeout_s
        while not condition():
            assert time.monotonic() < end, complaint
            self.page.wait_for_timeout(50)

    def until_shown(self) -> None:
        """Wait until the page holds all that the session says now: a key that it takes for disabled is lost."""
        shown, before = self.shown, self.shown.count
        # of the session of now: one that was looked up before may be passed over, where two come at once
        self.until(lambda: shown.session is self.app.session or shown.count > before + 1, "the session is not shown")
        count = shown.count
        self.until(lambda: (self.property(Shown.NODE, "axes_length") or 0) >= count, "the page stays behind")

    def until_drawn(self) -> None:
        """Wait until what the page holds is drawn: what can be grabbed is where it was drawn last."""
        self.page.evaluate(DRAWN)

    def until_idle(self, complaint: str = "a job does not end", timeout_s: float = PATIENCE_S) -> None:
        """Wait until nothing runs."""
        self.until(lambda: self.app.session.job is None, complaint, timeout_s)

    def until_planned(self, timeout_s: float = PATIENCE_S) -> None:
        """Wait until a good plan rests: no duration is tried, and nothing is replayed any more."""

        def rests(session: Session) -> bool:
            return session.fresh_plan is not None and session.job is None and not session.replaying

        self.until(lambda: rests(self.app.session), "no plan was found", timeout_s)
        self.until_shown()

    def until_ends_agree(self) -> None:
        """Wait until page and session have start and goal at the same places."""

        def agree() -> bool:
            ends = self.app.session.ends
            return all(np.allclose(self.position(which), ends.of(which).position, atol=1e-3) for which in EndRole)

        self.until(agree, "the page has start or goal elsewhere than the session")

    def settled(self, value: Callable[[], Any], quiet_s: float = 1.0) -> Any:
        """The value once it has stayed the same for `quiet_s`, letting the page live meanwhile."""
        now, since = value(), time.monotonic()
        end = since + PATIENCE_S
        while time.monotonic() - since < quiet_s:
            assert time.monotonic() < end, f"{now} goes on changing"
            self.page.wait_for_timeout(50)
            if (later := value()) != now:
                now, since = later, time.monotonic()
        return now

    def has_node(self, name: str) -> bool:
        """Whether the page holds a scene node of that name."""
        return self.page.evaluate("name => name in window.__viserSceneTree.getState()", name)

    def is_visible(self, name: str) -> bool:
        """Whether the page shows a scene node."""
        return self.page.evaluate(VISIBLE, name)

    def property(self, name: str, property: str) -> Any:
        """A property of a scene node as the page holds it; arrays come as flat lists."""
        return self.page.evaluate(PROPERTY, [name, property])

    def line(self, name: str) -> np.ndarray:
        """The points (n, 3) of a line as the page holds them; one that is nowhere, where it holds none."""
        held = self.property(name, "points") or 6 * [np.nan]
        points = np.array(held, dtype=np.float64).reshape(-1, 2, 3)
        return np.concatenate([points[:, 0], points[-1:, 1]])

    def shows(self, name: str, points: np.ndarray) -> bool:
        """Whether the page holds a line through these points (n, 3): while durations are tried, lines come and go."""
        drawn = self.line(name)
        return drawn.shape == points.shape and np.allclose(drawn, points, atol=1e-5)

    def position(self, which: EndRole) -> np.ndarray:
        """Where the page has the start or the goal [m]."""
        return np.array(self.page.evaluate(POSITION, f"/{which.value}"))

    def turn_to(self, name: str) -> None:
        """Open a tab of the side panel."""
        self.page.get_by_role("tab", name=name, exact=True).click()

    def handle(self, name: str) -> Any:
        """Find the handle of a widget by its name."""
        return named_handles(self.app._loop.parts)[name]

    def box(self, name: str) -> Locator:
        """Find the field of a number, a checkbox or a dropdown in the page."""
        return self.page.get_by_label(self.handle(name).label, exact=True)

    def boxes(self, name: str) -> Locator:
        """Find the fields of a text, a vector or a slider in the page."""
        return self.page.locator(f"div:has(> div > p label:text-is('{self.handle(name).label}'))").last.locator("input")

    def button(self, name: str, option: str | None = None) -> Locator:
        """Find a button in the page, or one of a group."""
        return self.page.get_by_role("button", name=option or self.handle(name).label, exact=True)

    def reach(self, name: str) -> None:
        """Open the tab of the side panel that a widget is in."""
        tab = position_of(self.handle(name)).tab
        if tab is not None:
            self.turn_to(tab)

    def press(self, name: str, option: str | None = None) -> None:
        """Click a button, or one of a group, in its tab."""
        self.reach(name)
        self.button(name, option).click()

    def key(self, name: str) -> None:
        """Press a key while nothing is being typed."""
        self.until_shown()
        self.page.evaluate("document.activeElement?.blur()")
        self.page.keyboard.press(name)

    def upload(self, button: str, file: Path) -> None:
        """Give a file to an upload button."""
        with self.page.expect_file_chooser() as chooser:
            self.press(button)
        chooser.value.set_files(file)

    def download(self, button: str) -> Path:
        """The file that a button gives, once nothing runs: some are made by jobs."""
        self.until_idle()
        with self.page.expect_download() as given:
            self.press(button)
        return Path(given.value.path())

    def export(self, format: str) -> Path:
        """The plan or the flight in a format."""
        self.choose("export.format", format)
        return self.download("export.download")

    def fill(self, name: str, text: str) -> None:
        """Type into a text or a slider's number, and confirm."""
        self.until_shown()  # or the page might overwrite the text with an older value
        box = self.boxes(name).last
        box.fill(text)
        box.press("Enter")

    def check(self, name: str) -> None:
        """Toggle a checkbox of the side panel."""
        self.reach(name)
        self.box(name).click()

    def choose(self, name: str, option: str) -> None:
        """Take an option of a dropdown of the side panel."""
        self.reach(name)
        self.box(name).click()
        self.page.get_by_role("option", name=option, exact=True).click()

    def unfold(self, name: str) -> None:
        """Open the folder that a widget is in."""
        self.reach(name)
        self.page.get_by_text(position_of(self.handle(name)).folder or "", exact=True).click()

    def on_screen(self, point: np.ndarray) -> tuple[float, float]:
        """Where a world point is in the page [pixels]."""
        return to_screen(self.page, point)

    def resting(self, point: Any) -> tuple[float, float]:
        """The same, once the camera rests and some frames were drawn."""
        x, y = self.settled(lambda: tuple(round(pixels, 1) for pixels in self.on_screen(point)), quiet_s=0.3)
        self.until_drawn()
        return x, y

    def click_at(self, point: tuple[float, float, float]) -> None:
        """Click into the scene where a world point is."""
        self.until_shown()
        place = list(self.resting(point))
        self.until(lambda: self.page.evaluate(IS_SCENE, place), "something lies over the scene there")
        self.page.mouse.click(*place)

    def drag_along_x(self, which: EndRole, distance: float, gizmo: float) -> None:
        """Drag the red arrow of an end's gizmo of size `gizmo` [m] by `distance` [m] along x."""
        grip = self.position(which) + np.array([0.8 * gizmo, 0, 0])
        self.drag(grip, grip + np.array([distance, 0, 0]))
        if self.app is not None:
            self.until_ends_agree()
            self.until(lambda: not self.app.session.held, "the hand does not let go")

    def drag(self, grip: np.ndarray, to: np.ndarray) -> None:
        """Drag what is at a world point to another one."""
        x0, y0 = self.on_screen(grip) if self.app is None else self.resting(grip)
        x1, y1 = self.on_screen(to)
        mouse = self.page.mouse
        mouse.move(x0, y0)
        self.until_drawn()
        mouse.down()
        for share in np.linspace(0, 1, 11)[1:]:
            mouse.move(x0 + share * (x1 - x0), y0 + share * (y1 - y0))
            self.page.wait_for_timeout(30)
        self.page.wait_for_timeout(150)
        mouse.up()

    def says(self, text: str) -> bool:
        """Whether the page shows a text somewhere."""
        return self.page.get_by_text(text).first.is_visible()

"""Make the pictures of README and docs/browser.md from the real app: plans and flights at Stonehenge, tab by tab.

    python static/make_pictures.py [stonehenge] [apartment]

Takes about three minutes; needs Chromium (the path below) and the `dev` extra.
"""

import argparse
import io
import time
from collections.abc import Callable
from pathlib import Path

from PIL import Image
from playwright.sync_api import Page, sync_playwright

from nerfnav.core.errors import NerfnavError
from nerfnav_app.server import App
from nerfnav_app.state.actions import (
    Adjust,
    ChooseTask,
    Pause,
    Resume,
    Settings,
    StartComparison,
    StartFlight,
    StartPlan,
)

CHROMIUM = "/usr/bin/chromium"
DRAWN_BY_SOFTWARE = [
    "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"
]  # fmt: skip
PORT = 8093
SIZE = {"width": 1280, "height": 800}
TASK, STEPS = "South-west to north-east", 8
ROOMS = "Living room to bedroom"
_QUIET = ".mantine-Notifications-root { display: none }"
_SEEN_BITS = 0xFC  # the last two bits of each colour are not seen, but fill the file


def main(places: list[str]) -> None:
    """Write the pictures of these places beside this file."""
    for place in places:
        app = App(place, port=PORT)
        app.start()
        try:
            with sync_playwright() as playwright:
                browser = playwright.chromium.launch(executable_path=CHROMIUM, args=DRAWN_BY_SOFTWARE)
                page = browser.new_page(viewport=SIZE, device_scale_factor=1)  # type: ignore[arg-type]
                load(app, page)
                PHOTOGRAPHED[place](app, page)
                browser.close()
        finally:
            app.stop()


def load(app: App, page: Page) -> None:
    """Open the page once its place has its texture."""
    wait(lambda: app.session.job is None and app.session.surface is not None and not app.session.surface_is_rough, 60)
    page.add_init_script("localStorage.setItem('nerfnav-help-seen', '1')")
    page.goto(f"{app.url}?fixedDpr=1")
    page.add_style_tag(content=_QUIET)


def photograph_tabs(app: App, page: Page) -> None:
    """Compare planners, plan, fly, and take a picture of each tab where it has most to show, and app.png."""
    plan(app, TASK)
    app.post(StartComparison())
    wait(lambda: len(app.session.comparison) == 4, 300)
    save(page, "Plan")
    fly_until(app, STEPS)
    app.post(Adjust(Settings.VIEW, "ellipsoid", 3.0))
    for tab in ("Scene", "Fly", "Estimate", "Runs", "Experiments", "Export"):
        save(page, tab)
    app.post(Resume())
    page.get_by_role("tab", name="Fly", exact=True).click()
    page.wait_for_timeout(900)  # the chart is drawn a little later than its tab
    write(page, "app")


def photograph_rooms(app: App, page: Page) -> None:
    """Fly from one room to the next, and take apartment.png."""
    plan(app, ROOMS)
    fly_until(app, 2 * STEPS)
    page.wait_for_timeout(4000)  # the scene fades in
    write(page, "apartment")


PHOTOGRAPHED = {"stonehenge": photograph_tabs, "apartment": photograph_rooms}


def plan(app: App, task: str) -> None:
    """Plan a task."""
    app.post(ChooseTask(task))
    app.post(StartPlan())
    wait(lambda: app.session.fresh_plan is not None and app.session.job is None, 120)


def fly_until(app: App, steps: int) -> None:
    """Fly that many time steps and hold."""
    app.post(Adjust(Settings.FLIGHT, "pace", 1.0))
    app.post(StartFlight())
    wait(lambda: app.session.flight is not None, 5)
    wait(lambda: app.session.steps_reported > steps or app.session.job is None, 300)
    if app.session.job is None:
        raise NerfnavError(f"the flight ended before time step {steps}: {app.session.notices[-1].body}")
    app.post(Pause())
    wait(lambda: app.session.job is not None and app.session.job.paused, 5)


def save(page: Page, tab: str) -> None:
    """Open a tab of the side panel and write its picture."""
    page.get_by_role("tab", name=tab, exact=True).click()
    page.wait_for_timeout(4000)  # the scene fades in
    write(page, tab.lower())


def write(page: Page, name: str) -> None:
    """Write what the browser shows."""
    picture = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    picture.point(lambda value: value & _SEEN_BITS).save(Path(__file__).with_name(f"{name}.png"), optimize=True)


def wait(condition: Callable[[], bool], limit_s: float) -> None:
    """Return once `condition` holds; TimeoutError after `limit_s`."""
    end = time.monotonic() + limit_s
    while not condition():
        if time.monotonic() > end:
            raise TimeoutError(f"nothing happened for {limit_s:.0f} s")
        time.sleep(0.05)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("places", nargs="*", metavar="place", help="of which; where none is said, of all")
    asked = parser.parse_args().places
    if unknown := set(asked) - set(PHOTOGRAPHED):
        parser.error(f"no pictures are made of {unknown.pop()!r}; known are: {', '.join(PHOTOGRAPHED)}")
    main(asked or list(PHOTOGRAPHED))

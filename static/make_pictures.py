"""Make the README's picture: the real app in a real browser, a real plan and a real flight at Stonehenge.

    python static/make_pictures.py

Takes about two minutes; needs Chromium (the path below) and the `dev` extra.
"""

import io
import time
from collections.abc import Callable
from pathlib import Path

from PIL import Image
from playwright.sync_api import Page, sync_playwright

from app.messages import ChooseTask, Pause, Resume, StartFlight, StartPlan
from app.server import App
from nerfnav.errors import NerfnavError

CHROMIUM = "/usr/bin/chromium"
PORT = 8093
SIZE = {"width": 1280, "height": 800}
TASK, STEPS = "Headline, across the ring", 12
_QUIET = ".mantine-Notifications-root { display: none }"


def main() -> None:
    """Write app.png beside this file."""
    app = App("stonehenge", port=PORT)
    app.start()
    try:
        fly_until(app, STEPS)
        picture = photograph(app)
    finally:
        app.stop()
    # the last two bits of each colour are not seen, but fill the file
    picture.point(lambda value: value & 0xFC).save(Path(__file__).with_name("app.png"), optimize=True)


def fly_until(app: App, steps: int) -> None:
    """Plan, then fly that many time steps and hold."""
    wait(lambda: app.session.job is None, 60)
    app.post(ChooseTask(TASK))
    app.post(StartPlan())
    wait(lambda: app.session.fresh_plan is not None and app.session.job is None, 120)
    app.post(StartFlight())
    wait(lambda: app.session.flight is not None, 5)
    wait(lambda: app.session.steps_reported > steps or app.session.job is None, 300)
    if app.session.job is None:
        raise NerfnavError(f"the flight ended before time step {steps}: {app.session.notices[-1].body}")
    app.post(Pause())
    wait(lambda: app.session.job is not None and app.session.job.paused, 5)


def photograph(app: App) -> Image.Image:
    """What a browser shows, scrolled to plan and flight, while the flight goes on."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=CHROMIUM,
            args=["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"],
        )
        page: Page = browser.new_page(viewport=SIZE, device_scale_factor=1)  # type: ignore[arg-type]
        page.goto(f"{app.url}?fixedDpr=1")
        page.add_style_tag(content=_QUIET)
        page.get_by_role("button", name="Step", exact=True).wait_for()
        app.post(Resume())
        page.locator(".uplot").first.evaluate("chart => chart.scrollIntoView({block: 'start'})")
        page.wait_for_timeout(8000)  # the scene fades in
        picture = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
        browser.close()
    return picture


def wait(condition: Callable[[], bool], limit_s: float) -> None:
    """Return once `condition` holds; TimeoutError after `limit_s`."""
    end = time.monotonic() + limit_s
    while not condition():
        if time.monotonic() > end:
            raise TimeoutError(f"nothing happened for {limit_s:.0f} s")
        time.sleep(0.05)


if __name__ == "__main__":
    main()

"""A real browser in front of a real server."""

import os
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, BrowserContext, Playwright, sync_playwright

from nerfnav_app.server import App
from nerfnav_app.worker.work import Work
from tests.browser.complaints import complaints_of
from tests.browser.shown import start_marked
from tests.browser.tab import Tab
from tests.waiting import PATIENCE_S, free_port

_CHROMIUMS = (Path("/usr/bin/chromium-headless-shell"), Path("/usr/bin/chromium"))
"""The same engine without and with a browser's own windows, which cost twice the page's time to load."""
_ARGUMENTS = [
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
    "--disable-background-networking",
    "--disable-quic",
    "--no-first-run",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
    "--disable-renderer-backgrounding",
    "--disable-gpu-compositing",  # the scene is drawn by WebGL all the same; the page around it costs less so
]


def pytest_itemcollected(item: pytest.Item) -> None:
    """Mark the tests of this folder: `-m "not browser"` leaves them out."""
    item.add_marker(pytest.mark.browser)


def launch(playwright: Playwright) -> Browser:
    """Chromium without a window, drawing in software."""
    path = next(path for path in _CHROMIUMS if path.exists())
    timeout = 1000 * PATIENCE_S
    return playwright.chromium.launch(executable_path=str(path), headless=True, args=_ARGUMENTS, timeout=timeout)


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """Chromium without a window; where CI is set it must be there, elsewhere its tests are skipped without it."""
    if not any(path.exists() for path in _CHROMIUMS):
        missing = f"{' and '.join(map(str, _CHROMIUMS))} are missing"
        if os.environ.get("CI"):
            pytest.fail(f"{missing}, and in CI the browser tests must run")
        pytest.skip(missing)
    with sync_playwright() as playwright:
        browser = launch(playwright)
        yield browser
        browser.close()


@pytest.fixture
def context(browser: Browser) -> Iterator[BrowserContext]:
    """A profile of its own, with small pages that software can draw quickly; no page of it may complain."""
    context = browser.new_context(viewport={"width": 1000, "height": 640}, accept_downloads=True)
    context.set_default_timeout(1000 * PATIENCE_S)
    complaints = complaints_of(context)
    yield context
    context.close()
    assert not complaints, f"the page complains: {complaints}"


@pytest.fixture
def serve() -> Iterator[Callable[..., App]]:
    """Starts apps on free ports, and stops them."""
    apps: list[App] = []

    def start(work: Work, token: str | None = None, what: str = "balls", remembers: bool = False) -> App:
        app = App(what, port=free_port(), token=token, work=work, remembers=remembers)
        apps.append(app)
        start_marked(app)
        return app

    yield start
    for app in apps:
        app.stop()


@pytest.fixture
def open_tab(context: BrowserContext) -> Callable[[App], Tab]:
    """Opens an app in a new tab, and waits until its place can be used."""

    def open_it(app: App) -> Tab:
        tab = Tab(context.new_page(), app)
        tab.load()
        return tab

    return open_it

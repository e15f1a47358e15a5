"""A report in a browser without network: tables, figures, and a flight that is drawn."""

from pathlib import Path

from playwright.sync_api import BrowserContext

from nerfnav.experiments.figures import panels
from nerfnav.experiments.study import Replay
from nerfnav_app.jobs.measure.report import ReportRequest, run, write_replays
from tests.app.following import result_of
from tests.app.jobs.measure.test_report import write_experiment
from tests.export.flights import flight

_DRAWN = "document.querySelector('canvas').getContext('webgl2') && document.getElementById('title').textContent"


def test_a_report_opens_without_network_and_its_first_flight_can_be_watched(
    context: BrowserContext, tmp_path: Path
) -> None:
    folder = write_experiment(tmp_path / "flights", "flights")
    panels(("one", "two"))[0].savefig(folder / "flights.png")
    write_replays(folder, {name: Replay("no such place", flight) for name in ("camera", "known")})
    (page_file,) = result_of(run(ReportRequest(folder))).files
    context.set_offline(True)
    page = context.new_page()
    requested: list[str] = []
    page.on("request", lambda request: requested.append(request.url))
    page.goto(page_file.as_uri())
    assert page.evaluate("document.images[0].naturalWidth") > 300
    page.locator("iframe").first.scroll_into_view_if_needed()
    frame = page.frames[1]
    frame.wait_for_function(_DRAWN)
    frame.click("#play")
    frame.wait_for_function("document.getElementById('at').value !== '0'")
    page.get_by_text("Flight: known").click()
    page.locator("iframe").nth(1).scroll_into_view_if_needed()
    page.wait_for_function("document.querySelectorAll('iframe')[1].getBoundingClientRect().height > 300")
    assert page.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
    assert all(url.startswith(("file:", "data:", "about:")) for url in requested), requested

"""What was flown before can be seen, moved through, compared, renamed, deleted and taken away."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from playwright.sync_api import BrowserContext

from nerfnav_app.jobs.events import JobEvents, JobResult, PlaceOpened
from nerfnav_app.server import App
from nerfnav_app.state.actions import Adjust, Settings, StartFlight
from nerfnav_app.storage.run_store import RunStore
from nerfnav_app.worker.backend import NavigationBackend
from tests.app.doubles import ScriptedWork, balls_place
from tests.app.storage.stored_runs import put
from tests.browser.tab import Tab
from tests.export.flights import flown
from tests.export.readers import poses_of_tum
from tests.waiting import PATIENCE_S, until

Serve = Callable[..., App]
OpenTab = Callable[[App], Tab]

_CARDS = "() => [...document.querySelectorAll('.card')].map(c => [c.offsetWidth, c.offsetHeight])"


def robot_of(tab: Tab, node: str = "/flight/robot") -> np.ndarray:
    """Where the page has a robot [m]."""
    return np.array(tab.property(node, "batched_positions")).reshape(-1, 3)[0]


def until_listed(tab: Tab, names: list[str]) -> None:
    """Wait until the page lists the flights of these names."""
    listed = tab.app.session.runs
    tab.until(lambda: [entry.name for entry in tab.app.session.runs.entries] == names, f"{listed} is listed")
    tab.until_shown()


def opening(*_: object) -> JobEvents:
    yield PlaceOpened(balls_place())
    return JobResult()


def test_a_flight_is_on_the_shelf_after_a_restart_and_its_timeline_moves_the_robot(
    serve: Serve, open_tab: OpenTab, tmp_path: Path
) -> None:
    first = serve(NavigationBackend(open=opening, runs=RunStore(tmp_path)))
    until(lambda: first.session.job is None and first.session.place, "the place was not opened")
    first.post(Adjust(Settings.FLIGHT, "open_loop", True))
    first.post(StartFlight())
    flown_and_listed = lambda: first.session.job is None and first.session.runs.entries  # noqa: E731
    until(flown_and_listed, "the flight is not listed", 3 * PATIENCE_S)
    flight = first.session.flight
    assert flight is not None
    first.stop()

    tab = open_tab(serve(ScriptedWork(runs=RunStore(tmp_path))))
    (entry,) = RunStore(tmp_path).entries()
    tab.turn_to("Runs")
    shelf = tab.box("runs.list")
    tab.until(lambda: shelf.input_value() == entry.name, "the flight is not listed")
    tab.press("runs.actions", "Open")
    tab.until(lambda: tab.is_visible("/flight/robot"), "the flight is not shown")
    for at in (3, len(flight.steps) - 1):
        tab.fill("timeline.slider", str(at * flight.steps[0].plan.dt))
        truth = flight.steps[at].truth.position.numpy()
        tab.until(lambda truth=truth: np.allclose(robot_of(tab), truth, atol=1e-5), "the robot stays where it was")
    tab.until(lambda: len(tab.line("/flight/truth")) == len(flight.steps), "its path is not drawn to its end")


def test_flights_are_compared_renamed_and_deleted_in_the_page(serve: Serve, open_tab: OpenTab, tmp_path: Path) -> None:
    shelf = RunStore(tmp_path)
    put(shelf, "second", date="2026-01-02T00:00:00+00:00")
    put(shelf, "first", flown()[:9], date="2026-01-01T00:00:00+00:00")
    tab = open_tab(serve(ScriptedWork(runs=shelf)))
    until_listed(tab, ["second", "first"])
    tab.press("runs.actions", "Open")
    tab.until(lambda: tab.is_visible("/flight/robot"), "the flight is not shown")
    tab.choose("runs.list", "first")
    tab.press("runs.actions", "Compare")
    tab.until(lambda: tab.is_visible("/compared/robot"), "the second flight is not shown")
    tab.until(lambda: tab.says("First: second. Second: first."), "their numbers are not beside each other")
    tab.fill("timeline.slider", str(5 * flown()[0].plan.dt))
    here = flown()[5].truth.position.numpy()
    for node in ("/flight/robot", "/compared/robot"):
        tab.until(lambda node=node: np.allclose(robot_of(tab, node), here, atol=1e-5), f"{node} is elsewhere")
    tab.press("runs.alone")
    tab.until(lambda: not tab.is_visible("/compared/robot"), "the second flight is still shown")

    tab.fill("runs.name", "../outside")
    tab.press("runs.change", "Rename")
    tab.until(lambda: tab.says("A name has up to 80 letters"), "a bad name is not refused")
    tab.fill("runs.name", "My best flight")
    tab.press("runs.change", "Rename")
    until_listed(tab, ["second", "My best flight"])
    assert [entry.name for entry in shelf.entries()] == ["second", "My best flight"]
    tab.choose("runs.list", "My best flight")
    for answer, left in (("Keep it", ["second", "My best flight"]), ("Delete for good", ["second"])):
        tab.press("runs.change", "Delete")
        button = tab.page.get_by_role("button", name=answer, exact=True)
        button.click()
        button.wait_for(state="hidden")
        until_listed(tab, left)
    assert [entry.name for entry in shelf.entries()] == ["second"]


def test_the_table_of_flights_is_sorted_filtered_and_picked_by_clicks_and_downloaded(
    serve: Serve, open_tab: OpenTab, tmp_path: Path
) -> None:
    shelf = RunStore(tmp_path)
    put(shelf, "old", date="2026-01-01T00:00:00+00:00")
    put(shelf, "far", place="pyramids", date="2026-01-02T00:00:00+00:00")
    put(shelf, "new", flown()[:9], date="2026-01-03T00:00:00+00:00")
    tab = open_tab(serve(ScriptedWork(runs=shelf)))
    until_listed(tab, ["new", "far", "old"])
    tab.turn_to("Runs")
    rows = tab.page.locator(".nerfnav-table tbody tr")
    order = lambda: rows.evaluate_all("rows => rows.map(row => row.dataset.value)")  # noqa: E731
    tab.until(lambda: order() == ["new", "far", "old"], "the newest is not the first")
    assert tab.box("runs.list").input_value() == "new"
    head = tab.page.locator("th [data-value='sort:steps']")
    head.click()
    tab.until(lambda: tab.box("runs.sort").input_value() == "steps", "a click on a head does not sort")
    head.click()
    tab.until(lambda: order()[-1] == "new", "a second click does not reverse")
    rows.filter(has_text="pyramids").click()
    tab.until(lambda: tab.box("runs.list").input_value() == "far", "a click on a row does not select")
    tab.press("runs.actions", "Compare")
    tab.until(lambda: tab.says("far was flown in pyramids, and balls is open: choose new or old."), "it is not refused")
    tab.press("runs.same")
    tab.until(lambda: sorted(order()) == ["new", "old"], "flights of other places stay in the list")
    names = [line.split(",")[0] for line in tab.download("runs.csv").read_text().splitlines()]
    assert sorted(names) == ["name", "new", "old"]


def test_a_flight_is_taken_away_as_files_as_a_replay_and_as_a_picture(
    serve: Serve, open_tab: OpenTab, context: BrowserContext, tmp_path: Path
) -> None:
    put(RunStore(tmp_path / "runs"), "flight")
    tab = open_tab(serve(ScriptedWork(runs=RunStore(tmp_path / "runs"))))
    until_listed(tab, ["flight"])
    tab.press("runs.actions", "Open")
    tab.until(lambda: tab.is_visible("/flight/robot"), "the flight is not shown")
    truth = np.stack([step.truth.position.numpy() for step in flown()])
    np.testing.assert_allclose(poses_of_tum(tab.export("tum").read_text())[1], truth, atol=1e-6)
    assert tab.export("mcap").read_bytes().startswith(b"\x89MCAP")
    page = tmp_path / "replay.html"
    page.write_bytes(tab.export("html").read_bytes())
    picture = cv2.imread(str(tab.download("screenshot.shot")))
    assert picture is not None and picture.shape == (720, 1280, 3) and picture.std() > 5

    told: list[str] = []
    replay = context.new_page()
    context.set_offline(True)
    replay.on("console", lambda message: told.append(message.text))
    replay.on("pageerror", lambda error: told.append(str(error)))
    replay.on("request", lambda request: told.append(request.url) if request.url.startswith("http") else None)
    replay.goto(page.as_uri())
    assert replay.locator("#time").text_content() == "1.60 s of 1.60 s"
    replay.locator("#at").fill("5")
    assert replay.locator("#time").text_content() == "0.50 s of 1.60 s"
    assert replay.locator("#about").text_content() == "quadrotor: on the way, first touched at 0.30 s."
    replay.locator("#at").fill("2")
    assert replay.locator("#about").text_content() == "quadrotor: on the way."
    replay.locator("#at").fill("5")
    # a pixel of the robot's colour shows that it is drawn
    shot = cv2.imdecode(np.frombuffer(replay.screenshot(), np.uint8), cv2.IMREAD_COLOR)
    assert shot is not None
    seen = shot[..., ::-1].astype(int)
    assert ((seen[..., 2] > 120) & (seen[..., 0] < 60) & (seen[..., 1] > 90)).sum() > 50
    replay.get_by_role("button", name="Play").click()
    replay.wait_for_function("document.getElementById('play').textContent === 'Play' && at > 15")
    replay.set_viewport_size({"width": 420, "height": 850})
    cards = replay.evaluate(_CARDS)
    assert sum(height for _, height in cards) < 0.4 * 850 and all(width <= 420 for width, _ in cards), "cards cover it"
    assert not told

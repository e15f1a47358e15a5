"""From a file or a bundled world to an exported flight, by the main buttons alone."""

import csv
import shutil
import threading
from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.sync_api import Download

from nerfnav_app.places.library import PlaceLibrary
from nerfnav_app.places.sources import BUDGETS_S, USUAL
from nerfnav_app.server import App
from nerfnav_app.state.session import Session
from nerfnav_app.worker.backend import NavigationBackend
from tests.app.jobs.field.test_meshes import pillars
from tests.browser.tab import Tab
from tests.browser.test_uploads import opening_work
from tests.importers.captures.test_depths import write_depths
from tests.importers.splat_files import ball_of_splats, write_dot_splat

_OPEN_S, _FLY_S = 240.0, 300.0


def settled(app: App) -> bool:
    """Whether a place is open and start and goal fit."""
    session = app.session
    known = len(session.problems) == 2 and not any(session.problems.values())
    return session.place is not None and session.job is None and known


def plan_fly_export(tab: Tab) -> Session:
    """Press the main button twice, and take the flight away."""
    app = tab.app
    tab.press("status.next.start_plan")
    tab.until_planned(_FLY_S)
    tab.until(lambda: tab.button("status.next.start_flight").is_visible(), "nothing offers to fly")
    asked = app.session.doubtful_plan is not None
    tab.press("status.next.start_flight")
    if asked:
        tab.press("status.anyway")
    tab.until(lambda: app.session.flight is not None and app.session.job is None, "the flight did not end", _FLY_S)
    flown = app.session
    assert flown.flight is not None and flown.flight.outcome is not None and len(flown.flight.steps) > 2
    tab.turn_to("Export")
    rows = list(csv.reader(tab.download("export.download").read_text().splitlines()))
    assert len(rows) > 3
    return flown


@pytest.mark.nightly  # splats are opened, turned and planned in by day too, and fields flown in
@pytest.mark.slow
def test_own_splats_are_opened_flown_in_and_kept(
    serve: Callable[..., App], open_tab: Callable[[App], Tab], tmp_path: Path
) -> None:
    file = tmp_path / "journey.splat"
    write_dot_splat(file, ball_of_splats(600))
    app = serve(opening_work())
    tab = open_tab(app)
    tab.turn_to("Scene")
    tab.upload("place.upload", file)
    tab.until(lambda: app.session.what.endswith("journey.splat") and settled(app), "it did not open", _OPEN_S)
    assert "journey" in [place.name for place in PlaceLibrary().entries()]
    flown = plan_fly_export(tab)
    assert flown.what == app.session.what and Path(flown.what).is_file()
    # brought again, it is opened as it is: nothing is made anew
    field = PlaceLibrary().place_of(flown.what)
    assert field is not None
    made, before = field.field_file.stat().st_mtime_ns, app.session.place
    tab.turn_to("Scene")
    tab.upload("place.upload", file)
    tab.until(lambda: app.session.place is not before and settled(app), "it did not open again", _OPEN_S)
    assert field.field_file.stat().st_mtime_ns == made and app.session.what == flown.what


@pytest.mark.slow
def test_an_own_mesh_is_learned_and_flown_in(
    serve: Callable[..., App], open_tab: Callable[[App], Tab], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(BUDGETS_S, USUAL, 3.0)
    may_open = threading.Event()
    app = serve(opening_work(may_open))
    tab = open_tab(app)
    tab.turn_to("Scene")
    mesh = pillars(tmp_path, at=(0.0,))
    tab.upload("place.upload", mesh)
    tab.until(lambda: app.session.place is None, "it is not being opened")
    tab.until(lambda: not tab.is_visible("/start"), "the ends of the last place are still shown")
    tab.until(lambda: tab.says("Opening"), "nothing says what is being done")
    may_open.set()
    tab.until(lambda: app.session.what.endswith(mesh.name) and settled(app), "it did not open", _OPEN_S)
    plan_fly_export(tab)


@pytest.mark.nightly  # trains as the journey of the mesh does; the rest of it is there too
@pytest.mark.slow
def test_an_own_capture_is_learned_and_flown_in(
    serve: Callable[..., App], open_tab: Callable[[App], Tab], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(BUDGETS_S, USUAL, 3.0)
    app = serve(opening_work())
    tab = open_tab(app)
    tab.turn_to("Scene")
    capture = shutil.make_archive(str(tmp_path / "ownroom"), "zip", write_depths(tmp_path / "ownroom"))
    tab.upload("place.upload", Path(capture))
    tab.until(lambda: app.session.what.endswith("ownroom.zip") and settled(app), "it did not open", _OPEN_S)
    assert "ownroom" in [place.name for place in PlaceLibrary().entries()]
    flown = plan_fly_export(tab)
    tab.until(lambda: len(app.session.runs.entries) > 0, "the flight is in no list")
    assert app.session.runs.entries[0].metadata.source == flown.what


@pytest.mark.slow
@pytest.mark.parametrize(("place", "robot"), [
    pytest.param("church", "couch", marks=pytest.mark.nightly), ("stonehenge", "diffdrive")
])  # fmt: skip
def test_robots_on_the_ground_are_chosen_planned_for_and_flown(
    browser_app: Callable[[str], Tab], place: str, robot: str
) -> None:
    tab = browser_app(place)
    tab.choose("place.robots.list", robot)
    tab.until(lambda: tab.app.session.choice.robot == robot and settled(tab.app), "it fits nowhere")
    session = tab.app.session
    assert session.place is not None
    assert session.task in [task.name for task in session.place.tasks if task.robot == robot]
    plan_fly_export(tab)


@pytest.fixture
def browser_app(serve: Callable[..., App], open_tab: Callable[[App], Tab]) -> Callable[[str], Tab]:
    """Serves a bundled place to a tab."""

    def start(place: str) -> Tab:
        return open_tab(serve(NavigationBackend(), what=place))

    return start


@pytest.mark.slow
def test_what_was_flown_is_exported_to_every_vehicle_and_a_refusal_offers_the_plan(
    browser_app: Callable[[str], Tab],
) -> None:
    tab = browser_app("stonehenge")
    tab.until(lambda: settled(tab.app), "it did not open", _OPEN_S)
    plan_fly_export(tab)
    tab.until(lambda: tab.is_visible("/flight/first_plan"), "the first plan is not drawn")
    for name in ("px4", "ardupilot", "crazyflie"):
        tab.choose("export.format", name)
        tab.until_shown()
        tab.until(lambda: tab.handle("export.subject").value == "Plan", "a vehicle is not offered the plan")
        made = download_of(tab, "export.download")
        assert made.suggested_filename == f"stonehenge-plan-{name}.csv" and Path(made.path()).stat().st_size > 1000
    tab.choose("export.subject", "Executed path")
    tab.press("export.download")
    tab.until(lambda: tab.says("The executed path is not exported for crazyflie"), "nothing says why")
    made = download_of(tab, "export.plan")
    assert made.suggested_filename == "stonehenge-plan-crazyflie.csv"
    tab.until(lambda: not tab.says("is not exported"), "the refusal stays")
    tab.unfold("view_settings.executed")
    tab.check("view_settings.executed")
    tab.until(lambda: not tab.is_visible("/flight/truth") and tab.is_visible("/flight/belief"), "the path stays")
    tab.turn_to("Runs")
    tab.until(lambda: tab.says("nerfnav fly stonehenge"), "no command is shown")


def download_of(tab: Tab, button: str) -> Download:
    """The download that a button gives, with its name."""
    tab.until_idle()
    with tab.page.expect_download() as given:
        tab.press(button)
    return given.value


def test_a_cart_too_large_for_stonehenge_is_told_so_in_one_sentence(browser_app: Callable[[str], Tab]) -> None:
    tab = browser_app("stonehenge")
    tab.choose("place.robots.list", "cart")
    tab.until(lambda: tab.says("for a cart, 50 cm long, in this place of 2.6 x 2.6 x 0.83 m"), "nobody says why")

"""Small things that a new user once stumbled over in the page."""

from collections.abc import Callable

from nerfnav.navigation import EpisodeOutcome
from nerfnav_app.page.panels.status.status import status
from nerfnav_app.places.library import PlaceLibrary
from nerfnav_app.server import App
from nerfnav_app.state.actions import Adjust, Settings
from tests.app.doubles import ScriptedWork
from tests.app.places.test_library import brought
from tests.browser.tab import Tab
from tests.browser.works import small_work

Serve = Callable[..., App]
OpenTab = Callable[[App], Tab]

_UPLOAD_OF_ANOTHER_TAB = """
() => {
  const root = document.createElement('div'), title = document.createElement('div');
  root.className = 'mantine-Notification-root'; root.id = 'of-another-tab';
  title.className = 'mantine-Notification-title'; title.textContent = 'Uploading undefined (12 %)';
  root.append(title);
  document.body.append(root);
}
"""
_ICON = """
name => [...document.querySelectorAll('button')].find(b => b.innerText.trim() === name)?.querySelector('svg')?.innerHTML
"""


def test_the_button_that_stops_has_no_play_triangle_and_the_line_says_how_it_goes_and_ends(
    serve: Serve, open_tab: OpenTab
) -> None:
    app = serve(small_work())
    tab = open_tab(app)
    play = tab.page.evaluate(_ICON, tab.handle("status.next.start_plan").label)
    tab.press("status.next.start_plan")
    tab.until_planned()
    tab.until(lambda: tab.says("Planned: "), "nobody says that there is a plan")
    app.post(Adjust(Settings.FLIGHT, "pace", 1e-4))  # so that the page, however slow, is seen while it flies
    tab.press("status.next.start_flight")
    tab.until(lambda: app.session.flight is not None, "it does not fly")
    stop = tab.handle("status.next.cancel")
    tab.until(lambda: tab.page.evaluate(_ICON, stop.label) not in (None, play), "Stop looks as if it began something")
    tab.until(lambda: tab.says("Flying, time step "), "the line does not say how far it is", 300)
    app.post(Adjust(Settings.FLIGHT, "pace", 0.0))
    tab.until(lambda: app.session.job is None, "the flight does not end", 300)
    flight = app.session.flight
    assert flight is not None and flight.outcome is not None
    word = "Arrived after" if flight.outcome is EpisodeOutcome.REACHED else "from the goal"
    ended = status(app.session).text
    assert word in ended
    tab.until(lambda: tab.says(ended), f"the line does not say {ended!r}")


def test_uploads_of_other_tabs_are_not_told_without_a_name(serve: Serve, open_tab: OpenTab) -> None:
    tab = open_tab(serve(ScriptedWork()))
    tab.page.evaluate(_UPLOAD_OF_ANOTHER_TAB)
    told = tab.page.locator("#of-another-tab")
    tab.until(lambda: not told.is_visible(), "every tab says Uploading undefined")


def test_only_what_can_be_opened_is_listed_and_what_was_learned_can_be_taken_away(
    serve: Serve, open_tab: OpenTab
) -> None:
    brought(PlaceLibrary(), "rock.splat", b"of the walk")
    tab = open_tab(serve(ScriptedWork()))
    tab.turn_to("Scene")
    tab.box("place.places").click()
    tab.page.get_by_role("option", name="stonehenge", exact=True).wait_for()
    rock = tab.page.get_by_role("option", name="rock", exact=True)
    tab.until(lambda: rock.count() == 1, "what was brought is in no list")
    assert tab.page.get_by_role("option", name="blocks", exact=True).count() == 0, "it has no field"
    tab.page.keyboard.press("Escape")
    rock.wait_for(state="hidden")  # or it would be chosen there
    tab.unfold("place_library.list")
    tab.box("place_library.list").click()
    rock.click()
    assert tab.download("place_library.download_field").read_bytes() == b"a field"


def test_how_well_an_own_capture_is_learned_is_chosen_with_the_time_that_it_takes(
    serve: Serve, open_tab: OpenTab
) -> None:
    app = serve(ScriptedWork())
    tab = open_tab(app)
    tab.choose("place.quality", "best: about 4 min")
    tab.until(lambda: app.session.quality == "best", "the choice is not taken")

"""Robots that are carried away and looked for, as the browser has it."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from nerfnav.estimator.relocalize.global_localization import RelocaliseStep
from nerfnav.navigation.supervisor import SupervisorAction
from nerfnav_app.server import App
from nerfnav_app.state.actions import Adjust, Settings
from tests.browser.tab import Tab
from tests.browser.works import calm_flights, small_work

Serve = Callable[..., App]
OpenTab = Callable[[App], Tab]


def last_search(app: App) -> RelocaliseStep | None:
    """The last search, if it has ended."""
    search = app.session.search
    return None if search is None or search.outcome is None else search.step


def moves(app: App) -> list[float]:
    """How far the robot has moved in each time step [m]."""
    flight = app.session.flight
    steps = flight.steps if flight is not None else ()
    return [0.0] + [(b.truth.position - a.truth.position).norm().item() for a, b in pairwise(steps)]


def step_until(tab: Tab, condition: Callable[[], bool], complaint: str) -> None:
    """Let a held flight take time steps: what is asked in the middle of one counts from the next."""
    for _ in range(3):
        before = tab.app.session.steps_reported
        tab.press("flight.steer", "Step")
        tab.until(lambda before=before: tab.app.session.steps_reported > before, "it does not go on")
        if condition():
            return
    raise AssertionError(complaint)


def test_a_robot_is_found_and_carried_away_in_flight_and_found_after_it(serve: Serve, open_tab: OpenTab) -> None:
    app = serve(small_work())
    tab = open_tab(app)
    calm_flights(app)
    # so slowly that it is held at its first time step, however slow the browser is
    app.post(Adjust(Settings.FLIGHT, "pace", 1e-4))
    tab.turn_to("Estimate")
    find = tab.button("estimate.find")
    tab.until(find.is_disabled, "a robot that saw nothing can be looked for")
    tab.key("f")
    tab.until(lambda: app.session.steps_reported > 0, "it does not fly")
    tab.press("flight.steer", "Pause")
    tab.until(lambda: app.session.job is not None and app.session.job.paused, "it does not hold")
    app.post(Adjust(Settings.FLIGHT, "pace", 0.0))
    step_until(tab, lambda: app.session.last_picture is not None, "it sees nothing")
    tab.press("estimate.find")
    step_until(tab, lambda: last_search(app) is not None, "the page was not told what the search found")
    tab.until(lambda: tab.is_visible("/search/ghosts"), "no candidate is shown")

    tab.press("estimate.kidnap")
    step_until(tab, lambda: max(moves(app)) > 0.45, "it was not carried away")
    tab.press("status.next.cancel")
    tab.until(lambda: app.session.job is None, "it flies on")
    flight = app.session.flight
    assert flight is not None
    assert flight.steps[int(np.argmax(moves(app)))].recovery is SupervisorAction.WIDENED, "it did not notice"

    told = last_search(app)
    tab.press("estimate.find")
    tab.until(lambda: app.session.job is None and last_search(app) is not told, "the search does not end", 60)
    step = last_search(app)
    assert step is not None
    places = step.body_poses().position.numpy()

    def shown() -> np.ndarray:
        return np.array(tab.property("/search/ghosts", "batched_positions")).reshape(-1, 3)

    tab.until(lambda: shown().shape == places.shape and np.allclose(shown(), places, atol=1e-5), "it is elsewhere")
    likely = f"1: {100 * step.weights[0].item():.0f} %"
    tab.until(lambda: tab.property("/search/label/0", "text") == likely, "the likeliest has no weight")
    tab.until(lambda: tab.is_visible("/search/frusta"), "the likeliest sees nothing")
    words = ", ".join(f"{value:.2f}" for value in places[0])
    tab.turn_to("Estimate")
    tab.until(lambda: tab.says(words), "the panel does not say where")
    tab.load()
    tab.until(lambda: tab.is_visible("/search/ghosts"), "a reload has forgotten what was found")

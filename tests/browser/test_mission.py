"""The whole way in the browser, with the real planner and the real filter: drag, plan, fly, arrive, take away."""

import csv
import io
import json
from collections.abc import Callable

import numpy as np

from nerfnav.navigation.episode import EpisodeOutcome
from nerfnav_app.page.layers.ends import GIZMO
from nerfnav_app.places.ends import EndRole
from nerfnav_app.server import App
from tests.browser.tab import Tab
from tests.browser.works import calm_flights, small_work


def test_a_robot_flies_to_the_dragged_goal_and_its_table_can_be_taken_away(
    serve: Callable[..., App], open_tab: Callable[[App], Tab]
) -> None:
    app = serve(small_work())
    tab = open_tab(app)
    tab.until(lambda: tab.has_node("/field"), "the field has no surface")
    tab.drag_along_x(EndRole.GOAL, -0.2, GIZMO)
    goal = np.array(app.session.ends.goal.position)

    tab.press("status.next.start_plan")
    tab.until(lambda: tab.is_visible("/plan/line"), "no iteration is shown")
    tab.until_planned()
    assert app.session.plan is not None and app.session.plan.latest is not None
    planned = app.session.plan.latest.motion.states.position.numpy()
    tab.until(lambda: tab.shows("/plan/line", planned), "the page shows another plan")
    np.testing.assert_allclose(planned[-1], goal, atol=1e-4)

    calm_flights(app)
    tab.press("status.next.start_flight")
    tab.until(lambda: app.session.flight is not None and app.session.job is None, "the flight did not end", 300)
    flight = app.session.flight
    assert flight is not None and flight.outcome is EpisodeOutcome.REACHED
    tab.turn_to("Fly")
    tab.until(lambda: tab.says("The robot is at the goal."), "the page does not say that the robot arrived")
    tab.until(lambda: len(tab.line("/flight/truth")) == len(flight.steps), "the path is not that of the flight")
    assert np.linalg.norm(tab.line("/flight/truth")[-1] - goal) < 0.12

    rows = list(csv.DictReader(io.StringIO(tab.export("csv").read_text())))
    assert len(rows) == len(flight.steps)
    truth = np.array([[float(row[f"{name} [m]"]) for name in "xyz"] for row in rows])
    np.testing.assert_allclose(truth, tab.line("/flight/truth"), atol=1e-5)
    assert json.loads(tab.export("json").read_text())["format"].startswith("nerfnav")
    assert tab.export("px4").read_text().startswith("# px4_msgs")  # which the worker has judged in the field

    flown = tab.line("/flight/truth")
    tab.load()
    tab.until(lambda: np.array_equal(tab.line("/flight/truth"), flown), "a reload has lost the path")
    tab.turn_to("Fly")
    tab.until(lambda: tab.says("The robot is at the goal."), "a reload has lost the flight")

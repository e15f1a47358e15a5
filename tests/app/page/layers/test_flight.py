"""The three things of a flight in the scene: first plan, executed path and estimate, each under its name."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import viser

from nerfnav.planner.steps import PlanOutcome
from nerfnav_app.page.kit.theme import BELIEF, PLAN, TRUTH
from nerfnav_app.page.layers.flight import FlightLayer
from nerfnav_app.page.layers.plan import PlanLayer, PlanStyle, choose_plan_style
from nerfnav_app.page.panels.place.view_settings import ViewSettingsPanel
from nerfnav_app.places.ends import End, Ends
from nerfnav_app.reducers.root import reduce
from nerfnav_app.state.actions import Adjust, Settings
from nerfnav_app.state.flight import FlightRecord
from nerfnav_app.state.plan import PlanRecord
from nerfnav_app.state.session import Session
from nerfnav_app.state.view import CameraMode
from tests.app.doubles import balls_place, plan_step, straight_motion
from tests.export.flights import arrived

ENDS = Ends(End((-0.7, 0.0, 0.4)), End((0.7, 0.1, 0.4)))
NODES = {"plan": "_first_plan", "executed": "_truth", "estimate": "_belief"}
COLORS = {"plan": PLAN, "executed": TRUTH, "estimate": BELIEF}


def flown() -> Session:
    return Session("balls", place=balls_place(), ends=ENDS, flight=FlightRecord(ENDS, arrived(straight_motion(ENDS))))


def node(layer: FlightLayer, part: str) -> Any:
    return getattr(layer, NODES[part])._fans[0]._node


def test_first_plan_executed_path_and_estimate_are_three_lines_in_the_colours_of_the_theme(
    server: viser.ViserServer,
) -> None:
    layer = FlightLayer(server)
    layer.show(flown())
    for part, color in COLORS.items():
        colors = np.array(node(layer, part).colors).reshape(-1, 3)
        assert node(layer, part).visible and np.unique(colors, axis=0).tolist() == [list(color)]
    names = [node(layer, part).name for part in NODES]
    assert names == ["/flight/first_plan", "/flight/truth", "/flight/belief"]
    first = flown().flight.steps[0].first_plan  # type: ignore[union-attr]
    assert first is not None
    np.testing.assert_allclose(node(layer, "plan").points[0, 0], first.states.position[0], atol=1e-6)


@pytest.mark.parametrize("part", NODES)
def test_each_of_the_three_is_switched_off_and_on_alone(server: viser.ViserServer, part: str) -> None:
    layer, panel, session = FlightLayer(server), ViewSettingsPanel(server, lambda command: None), flown()
    for on in (True, False, True):
        session = reduce(session, Adjust(Settings.VIEW, part, on))
        layer.show(session)
        panel.show(session)
        assert {each: node(layer, each).visible for each in NODES} == {each: on or each != part for each in NODES}
        assert getattr(panel, f"_{part}").value is on


def test_a_plan_that_was_not_flown_is_switched_off_by_the_same_box() -> None:
    session = Session("balls", place=balls_place(), ends=ENDS, plan=PlanRecord(ENDS).with_step(plan_step(ENDS, 0)))
    assert choose_plan_style(session) is PlanStyle.WANTED
    assert choose_plan_style(reduce(session, Adjust(Settings.VIEW, "plan", False))) is PlanStyle.HIDDEN


def test_a_replay_shows_the_first_plan_from_its_first_step_on(server: viser.ViserServer) -> None:
    layer, session = FlightLayer(server), flown()
    assert session.flight is not None
    layer.show(replace(session, flight=session.flight.cut(0)))
    assert node(layer, "plan").visible and not node(layer, "executed").visible


def visible(server: viser.ViserServer) -> set[str]:
    """Names of the nodes of a layer that are drawn."""
    handles = server.scene._handle_from_node_name.items()
    return {name for name, handle in handles if name.count("/") > 1 and handle.visible}


def test_the_robots_own_view_is_free_of_its_marks_and_keeps_the_lines(server: viser.ViserServer) -> None:
    layer, session = FlightLayer(server), flown()
    layer.show(session)
    free = visible(server)
    marks = {f"/flight/{name}" for name in ("attitude", "covariance", "means", "ghost", "robot")}
    assert marks <= free
    layer.show(reduce(session, Adjust(Settings.VIEW, "camera", CameraMode.ROBOT)))
    assert visible(server) == free - marks and {"/flight/first_plan", "/flight/truth", "/flight/belief"} <= free
    layer.show(session)
    assert visible(server) == free


def test_the_robots_own_view_is_free_of_the_bodies_along_a_plan(server: viser.ViserServer) -> None:
    plan = PlanRecord(ENDS).with_step(plan_step(ENDS, 0, PlanOutcome.CONVERGED))
    session, layer = Session("balls", place=balls_place(), ends=ENDS, plan=plan), PlanLayer(server)
    layer.show(session)
    assert {"/plan/bodies", "/plan/line"} <= visible(server)
    layer.show(reduce(session, Adjust(Settings.VIEW, "camera", CameraMode.ROBOT)))
    assert "/plan/bodies" not in visible(server) and "/plan/line" in visible(server)

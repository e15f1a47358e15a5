"""How the robot knows where it is, and how sure it is of that."""

from collections.abc import Callable

import viser

from nerfnav.estimator import estimators
from nerfnav_app.page.html import note
from nerfnav_app.page.panels.binder import Binder
from nerfnav_app.page.panels.dropdown import ChoiceList
from nerfnav_app.page.panels.estimate_words import describe, found
from nerfnav_app.page.panels.flight_charts import ERRORS, FlightChart
from nerfnav_app.state.actions import CarryAway, Command, FindRobot, Settings
from nerfnav_app.state.session import Session


class EstimatePanel:
    """The estimator, its numbers at the last time step, and its error over the flight."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """`post` takes what the user asks."""
        self._estimator = ChoiceList(server, "estimator", estimators.names(), "How the robot knows where it is", post)
        self._ellipsoid = server.gui.add_slider(
            "Ellipsoids ×", 1.0, 10.0, 0.5, 1.0, hint="Draw the 95 % regions larger than they are"
        )
        Binder(Settings.VIEW, post)(self._ellipsoid, "ellipsoid", float)
        self._find = server.gui.add_button(
            "Find the robot", icon=viser.Icon.MAP_SEARCH, disabled=True,
            hint="Look for it everywhere by its last picture alone, as if nothing were known",
        )  # fmt: skip
        self._carry = server.gui.add_button(
            "Put it elsewhere", color="gray", icon=viser.Icon.HAND_GRAB, visible=False,
            hint="Kidnapped robot: the flying robot is put down somewhere else, without being told",
        )  # fmt: skip
        self._found = server.gui.add_html("", visible=False)
        self._numbers = server.gui.add_html(note("Opening…"))
        self._errors = FlightChart(server, ERRORS)

        @self._find.on_click
        async def _(_: viser.GuiEvent) -> None:
            post(FindRobot())

        @self._carry.on_click
        async def _(_: viser.GuiEvent) -> None:
            post(CarryAway())

    def show(self, session: Session) -> None:
        """Show the estimate of the last time step."""
        self._estimator.show(session)
        self._ellipsoid.value = session.view_settings.ellipsoid
        self._errors.show(session)
        self._find.disabled = not session.may_find
        self._carry.visible = session.in_flight
        self._found.visible = session.search is not None
        if session.search is not None:
            self._found.content = found(session.search.step)
        self._numbers.visible = session.track is None
        self._numbers.content = describe(session.shown_flight)

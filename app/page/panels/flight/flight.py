"""Hold, step and push, and the numbers of the flight."""

from collections.abc import Callable

import numpy as np
import viser

from nerfnav.robots import ATTITUDE, POSITION
from nerfnav_app.page.kit.html import note, table, warning
from nerfnav_app.page.panels.flight.flight_charts import TIMES, FlightChart
from nerfnav_app.page.panels.flight_settings import FlyingPanel
from nerfnav_app.state.actions import Command, Gust, Pause, Resume, StepOnce
from nerfnav_app.state.records import FlightRecord
from nerfnav_app.state.session import Session
from nerfnav_app.text import number, sentence


class FlightPanel:
    """The buttons, the settings, the numbers and the charts of the flight."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """`post` takes what the user asks."""
        self._steer = server.gui.add_button_group("Flight", ("Pause", "Step"), visible=False)
        self._gust = server.gui.add_button(
            "Gust", color="gray", icon=viser.Icon.WIND, visible=False, hint="Push the robot, now"
        )
        self._settings = FlyingPanel(server, post)
        self._numbers = server.gui.add_html("")
        self._times = FlightChart(server, TIMES)

        @self._gust.on_click
        async def _(_: viser.GuiEvent) -> None:
            post(Gust())

        @self._steer.on_click
        async def _(event: viser.GuiEvent) -> None:
            commands = {"Pause": Pause(), "Resume": Resume(), "Step": StepOnce()}
            if event.target.value in commands:
                post(commands[event.target.value])

    def show(self, session: Session) -> None:
        """Show the flight as far as it is."""
        job, flying = session.job, session.in_flight
        self._steer.visible = self._gust.visible = flying
        self._settings.show(session)
        self._times.show(session)
        if job is not None:
            self._steer.options = ("Resume" if job.paused else "Pause", "Step")
        self._numbers.content = describe(session.shown_flight, session.flight_is_stale, flying)


def describe(flight: FlightRecord | None, stale: bool, flying: bool) -> str:
    """The numbers of a flight, as HTML."""
    if flight is None or not flight.steps:
        return note(
            "Planning the way…" if flying else "Not flown yet: press Fly it, and the robot goes by its camera alone."
        )
    last = flight.steps[-1]
    error = last.truth.local(last.belief.mean)
    deviation = last.belief.covariance.diagonal()[POSITION].sum().sqrt().item()
    rows = [
        ("Time", number(last.time, "s")),
        ("Position error", number(100 * error[POSITION].norm().item(), "cm")),
        ("Expected position error", number(100 * deviation, "cm"), "Root of the trace of the position's covariance"),
        ("Attitude error", number(np.rad2deg(error[ATTITUDE].norm().item()), "°")),
        ("Filter", number(last.filter_ms, "ms")),
        ("Replanning", number(last.replan_ms, "ms")),
        ("Late steps", str(sum(step.late for step in flight.steps))),
        ("Time steps in contact", str(sum(step.touched for step in flight.steps)), "With the ground-truth mesh"),
    ]
    words = sentence(flight.outcome.value) if flight.outcome is not None else ""
    if not words and not flying:
        words = "Stopped on the way."
    remark = warning("Start or goal have moved since: this flight was between the earlier ones.") if stale else ""
    return table(rows) + (note(words) if words else "") + remark

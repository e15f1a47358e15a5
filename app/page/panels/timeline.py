"""The timeline of a flight that has ended: which time step the page shows."""

from collections.abc import Callable

import viser

from app.state.actions import Command
from app.state.records import FlightRecord
from app.state.run_actions import PlayBack, Scrub
from app.state.session import Session

_PLAY, _PAUSE = "Play back", "Hold"


class TimelinePanel:
    """A slider over the time steps and a button that moves it, above the tabs, for they all show that time."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """`post` takes what the user asks."""
        self._post = post
        self._slider = server.gui.add_slider(
            "Time step", 0, 1, 1, 0, visible=False, hint="Which moment of the flight is shown"
        )
        self._button = server.gui.add_button(_PLAY, icon=viser.Icon.PLAYER_PLAY, color="gray", visible=False)
        self._flight: FlightRecord | None = None
        self._asked: int | None = None
        self._playing = False
        self._slider.on_update(self._scrub)

        @self._button.on_click
        async def _(_: viser.GuiEvent) -> None:
            post(PlayBack(not self._playing))

    async def _scrub(self, event: viser.GuiEvent) -> None:
        if event.client is None:
            return  # the session wrote it
        self._asked = round(self._slider.value)
        self._post(Scrub(self._asked))

    def show(self, session: Session) -> None:
        """Show the timeline where there is something to look back at."""
        flight, shown = session.flight, session.shown_flight
        visible = flight is not None and len(flight.steps) > 1 and not session.in_flight
        self._slider.visible = self._button.visible = visible
        if not visible or flight is None or shown is None:
            return
        if flight is not self._flight:
            self._flight, self._asked = flight, None
            self._slider.max = len(flight.steps) - 1
        at = len(shown.steps) - 1
        # a hand that holds the slider is ahead of the session: it must not be pulled back
        if self._asked in (None, at) or session.runs.timeline.playing:
            self._asked = None
            self._slider.value = at
        if self._playing != session.runs.timeline.playing:
            self._playing = session.runs.timeline.playing
            self._button.label = _PAUSE if self._playing else _PLAY
            self._button.icon = viser.Icon.PLAYER_PAUSE if self._playing else viser.Icon.PLAYER_PLAY

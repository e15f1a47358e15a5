"""What is open and what is happening, always at the top."""

from collections.abc import Callable

import viser

from nerfnav_app.page.kit.html import heading, legend
from nerfnav_app.page.kit.theme import BELIEF, GOAL, HIT, PLAN, START, TRUTH
from nerfnav_app.page.panels.next_buttons import NextButtons
from nerfnav_app.page.panels.status_words import asks, status
from nerfnav_app.places.sources import title_of
from nerfnav_app.state.actions import Command, Redo, Reset, StartFlight, Undo
from nerfnav_app.state.plan_actions import StayDown
from nerfnav_app.state.session import Session

_MEANINGS = (
    (START, "start"),
    (GOAL, "goal"),
    (PLAN, "plan"),
    (TRUTH, "true path"),
    (BELIEF, "estimate, 95 % covariance"),
    (HIT, "hit"),
)
_CHANGES: dict[str, Command] = {"Undo": Undo(), "Redo": Redo(), "Reset": Reset()}


class StatusPanel:
    """The place's name, one line on what is done or how it ended, and the button for what comes next."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """`post` takes what the user asks."""
        self._title = server.gui.add_html(heading("nerfnav"))
        self._status = server.gui.add_html("")
        self._next = NextButtons(server, post)
        self._anyway = server.gui.add_button("Fly all the same", color="red", visible=False)
        self._stay = server.gui.add_button("Do not fly", color="gray", visible=False)
        self._progress = server.gui.add_progress_bar(0.0, visible=False, animated=True)
        self._back = server.gui.add_button_group("Changes", tuple(_CHANGES), hint="Ctrl+Z, Ctrl+Y, shift+R")
        self._legend = server.gui.add_html(legend(_MEANINGS))

        @self._back.on_click
        async def _(event: viser.GuiEvent) -> None:
            if event.client is not None:
                post(_CHANGES[event.target.value])

        @self._anyway.on_click
        async def _(_: viser.GuiEvent) -> None:
            post(StartFlight(anyway=True))

        @self._stay.on_click
        async def _(_: viser.GuiEvent) -> None:
            post(StayDown())

    def show(self, session: Session) -> None:
        """Say what is open and what is being done."""
        job, now = session.job, status(session)
        self._title.content = heading(session.place.name if session.place is not None else title_of(session.what))
        self._status.content = now.html(now.text)
        self._progress.visible = job is not None and not job.paused
        self._progress.value = 100 * (job.fraction or 0.0) if job is not None else 0.0
        self._next.show(session, visible=not asks(session))
        self._back.visible = session.place is not None
        self._anyway.visible = self._stay.visible = asks(session)

"""Which place is open, and what moves in it."""

from collections.abc import Callable

import viser

import scenes
from app.messages import Command, OpenPlace
from app.panels.choice import ChoiceList
from app.session import Session
from nerfnav import robots


class PlacePanel:
    """A list of the bundled places, and of the robots."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """`post` takes what the user asks."""
        self._post = post
        self._session: Session | None = None
        self._places: viser.GuiDropdownHandle[str] = server.gui.add_dropdown(
            "Place", list[str](scenes.names()), hint="Bundled worlds, and the file that was opened"
        )
        self._places.on_update(self._open)
        self._robots = ChoiceList(server, "robot", robots.names(), "What moves: its body and its dynamics", post)

    async def _open(self, event: viser.GuiEvent) -> None:
        if event.client is not None and self._session is not None and self._places.value != self._session.what:
            self._post(OpenPlace(str(self._places.value)))

    def show(self, session: Session) -> None:
        """Show what is open and chosen."""
        self._session = session
        before = session.before.what if session.before is not None else session.what
        options = tuple(dict.fromkeys((*scenes.names(), before, session.what)))
        if self._places.options != options:
            self._places.options = options
        self._places.value = session.what
        self._robots.show(session)

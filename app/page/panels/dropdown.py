"""A list of names, one of which is taken: robots, planners, estimators."""

from collections.abc import Callable, Iterable
from dataclasses import replace

import viser

from app.state.actions import Choose, Command
from app.state.session import Session
from app.text import capital


class ChoiceList:
    """The dropdown of one field of `Choice`."""

    def __init__(
        self, server: viser.ViserServer, field: str, names: Iterable[str], hint: str, post: Callable[[Command], None]
    ) -> None:
        """`field` is the name of the field, whose values are among `names`; `post` takes what the user asks."""
        self._field, self._post = field, post
        self._session: Session | None = None
        self._list: viser.GuiDropdownHandle[str] = server.gui.add_dropdown(
            capital(field), list[str](names), hint=hint
        )
        self._list.on_update(self._take)

    async def _take(self, event: viser.GuiEvent) -> None:
        if event.client is not None and self._session is not None:
            self._post(Choose(replace(self._session.choice, **{self._field: str(self._list.value)})))

    def show(self, session: Session) -> None:
        """Show what is chosen."""
        self._session = session
        self._list.value = getattr(session.choice, self._field)

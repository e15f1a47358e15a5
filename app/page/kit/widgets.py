"""From widgets to settings: what a person sets becomes a message about that one number."""

from collections.abc import Callable
from typing import Any

import viser

from nerfnav_app.state.actions import Adjust, Command, Settings


class Binder:
    """Binds the widgets of one kind of settings."""

    def __init__(self, settings: Settings, post: Callable[[Command], None]) -> None:
        """`post` takes what the user asks."""
        self._settings, self._post = settings, post

    def __call__(self, widget: Any, name: str, read: Callable[[Any], Any]) -> None:
        """Let `widget` set the field `name`; `read` makes the field's value of the widget's."""

        async def take(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None:  # else the session wrote it
                self._post(Adjust(self._settings, name, read(widget.value)))

        widget.on_update(take)

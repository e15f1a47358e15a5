"""What pages were told: a part of the page after all others, so that tests can wait for a page to be up to date."""

import threading
from collections.abc import Callable
from typing import Any

import viser

from nerfnav_app.server import App
from nerfnav_app.state.session import Session


class Shown:
    """The last part of a page: a mark in the scene, which arrives after all that the other parts have said."""

    NODE = "/shown"

    def __init__(self, server: viser.ViserServer) -> None:
        self._mark = server.scene.add_frame(self.NODE, show_axes=False, visible=False)
        self._watched: list[tuple[Callable[[Session], Any], threading.Event]] = []
        self.session: Session | None = None
        """What the page was told last."""
        self.count = 0
        """How often it was told something: the mark says so too."""

    def show(self, session: Session) -> None:
        """Move the mark."""
        self._mark.axes_length = float(self.count + 1)
        self.session, self.count = session, self.count + 1
        for condition, happened in self._watched:
            if condition(session):
                happened.set()

    def watch(self, condition: Callable[[Session], Any]) -> threading.Event:
        """What is set once the page shows a session of this kind, be it for a moment."""
        happened = threading.Event()
        self._watched.append((condition, happened))
        return happened


def start_marked(app: App) -> None:
    """Start an app whose page has this part."""
    begin = app._loop.start

    def begin_marked(parts: tuple[Any, ...], *told: Any) -> None:
        assert app._server is not None
        begin((*parts, Shown(app._server)), *told)

    app._loop.start = begin_marked  # type: ignore[method-assign]
    app.start()

"""Panel protocol: a part of the page in words and widgets, made on a page and shown each session."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import viser

from nerfnav_app.places.library import PlaceLibrary
from nerfnav_app.state.actions import Command
from nerfnav_app.state.session import Session


class Panel(Protocol):
    """A part of the page in words and widgets."""

    def show(self, session: Session) -> None:
        """Show the session, by changing what has changed."""
        ...


@dataclass(frozen=True)
class Page:
    """What panels are made of."""

    server: viser.ViserServer
    """Takes the widgets."""
    post: Callable[[Command], None]
    """Takes what the user asks."""
    library: PlaceLibrary
    """Takes the files that the user brings, and keeps their places."""


@dataclass(frozen=True)
class PanelEntry:
    """A panel, and its place on the page."""

    name: str
    """What errors call it."""
    make: Callable[[Page], Panel]
    """Puts up its widgets, and gives what shows the session in them."""
    tab: str | None = None
    """Title of the tab that it is in, below the panels that are there already; None: above all tabs, always seen."""
    icon: viser.IconName | None = None
    """Of the tab, where this panel is the first in it."""

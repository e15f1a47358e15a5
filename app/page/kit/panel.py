"""Panel protocol: a part of the page with widgets and texts that shows each session."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import viser

from nerfnav_app.places.library import PlaceLibrary
from nerfnav_app.state.actions import Command
from nerfnav_app.state.session import Session


class Panel(Protocol):
    """A part of the page: widgets and texts, or nodes of the 3D scene."""

    def show(self, session: Session) -> None:
        """Show the session: update what has changed."""
        ...


@dataclass(frozen=True)
class Page:
    """Context of a panel: the server, the session's inbox and the library."""

    server: viser.ViserServer
    """Server of the widgets."""
    post: Callable[[Command], None]
    """Inbox for the user's commands."""
    library: PlaceLibrary
    """Store of uploaded files and their places."""


@dataclass(frozen=True)
class PanelEntry:
    """Registry entry of a panel: its maker and its tab."""

    name: str
    """Its name in errors."""
    make: Callable[[Page], Panel]
    """Add its widgets to the page, and return the panel."""
    tab: str | None = None
    """Title of its tab, below the panels registered before it; None: above all tabs, always visible."""
    icon: viser.IconName | None = None
    """Icon of the tab, where this panel is its first."""

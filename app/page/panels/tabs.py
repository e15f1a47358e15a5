"""The panels of the page: what is happening always at the top, everything else in tabs, in the order of use."""

from collections.abc import Callable
from typing import Protocol

import viser

from app.page.panels.camera import CameraPanel
from app.page.panels.command_palette import CommandPalette
from app.page.panels.ends import EndsPanel
from app.page.panels.estimate import EstimatePanel
from app.page.panels.experiments import ExperimentsPanel
from app.page.panels.export import ExportPanel
from app.page.panels.flight import FlightPanel
from app.page.panels.place import PlacePanel
from app.page.panels.plan import PlanPanel
from app.page.panels.runs import RunsPanel
from app.page.panels.status import StatusPanel
from app.page.panels.timeline import TimelinePanel
from app.page.panels.view_settings import ViewSettingsPanel
from app.places.uploads import Uploads
from app.state.actions import Command
from app.state.session import Session


class Panel(Protocol):
    """A part of the page in words and widgets."""

    def show(self, session: Session) -> None:
        """Show the session, by changing what has changed."""
        ...


def panels(server: viser.ViserServer, post: Callable[[Command], None], uploads: Uploads) -> tuple[Panel, ...]:
    """Put up all panels; `post` takes what the user asks, `uploads` what the user brings."""
    made: list[Panel] = [StatusPanel(server, post), TimelinePanel(server, post)]
    made += [CameraPanel(server), CommandPalette(server, post)]
    tabs = server.gui.add_tab_group()
    with tabs.add_tab("Scene", viser.Icon.MAP_2):
        made += [PlacePanel(server, post, uploads), EndsPanel(server, post), ViewSettingsPanel(server, post)]
    with tabs.add_tab("Plan", viser.Icon.ROUTE):
        made += [PlanPanel(server, post)]
    with tabs.add_tab("Fly", viser.Icon.DRONE):
        made += [FlightPanel(server, post)]
    with tabs.add_tab("Estimate", viser.Icon.FOCUS_2):
        made += [EstimatePanel(server, post)]
    with tabs.add_tab("Runs", viser.Icon.HISTORY):
        made += [RunsPanel(server, post)]
    with tabs.add_tab("Experiments", viser.Icon.FLASK):
        made += [ExperimentsPanel(server, post)]
    with tabs.add_tab("Export", viser.Icon.DOWNLOAD):
        made += [ExportPanel(server, post)]
    return tuple(made)

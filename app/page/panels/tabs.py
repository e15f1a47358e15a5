"""The panels of the page: what is happening always at the top, everything else in tabs, in the order of use.

A new panel is a file beside this one and a line in PANELS; `register` adds one from outside before the page is put up.
"""

import viser

from app.page.panels.camera import CameraPanel
from app.page.panels.command_palette import CommandPalette
from app.page.panels.ends import EndsPanel
from app.page.panels.estimate import EstimatePanel
from app.page.panels.experiments import ExperimentsPanel
from app.page.panels.export import ExportPanel
from app.page.panels.flight import FlightPanel
from app.page.panels.kept_places import KeptPlacesPanel
from app.page.panels.map import MapPanel
from app.page.panels.panel import Page, Panel, PanelEntry
from app.page.panels.place import PlacePanel
from app.page.panels.placing import PlacingPanel
from app.page.panels.plan import PlanPanel
from app.page.panels.robot import RobotPanel
from app.page.panels.runs import RunsPanel
from app.page.panels.status import StatusPanel
from app.page.panels.timeline import TimelinePanel
from app.page.panels.view_settings import ViewSettingsPanel
from nerfnav.registry import Registry

_ICON = viser.Icon

PANELS: Registry[PanelEntry] = Registry("panel", (
    PanelEntry("status", lambda page: StatusPanel(page.server, page.post)),
    PanelEntry("timeline", lambda page: TimelinePanel(page.server, page.post)),
    PanelEntry("camera", lambda page: CameraPanel(page.server)),
    PanelEntry("command palette", lambda page: CommandPalette(page.server, page.post)),
    PanelEntry("place", lambda page: PlacePanel(page.server, page.post, page.library), "Scene", _ICON.MAP_2),
    PanelEntry("kept places", lambda page: KeptPlacesPanel(page.server, page.post, page.library), "Scene"),
    PanelEntry("ends", lambda page: EndsPanel(page.server, page.post), "Scene"),
    PanelEntry("robot", lambda page: RobotPanel(page.server, page.post, page.library), "Scene"),
    PanelEntry("placing", lambda page: PlacingPanel(page.server, page.post), "Scene"),
    PanelEntry("view settings", lambda page: ViewSettingsPanel(page.server, page.post), "Scene"),
    PanelEntry("plan", lambda page: PlanPanel(page.server, page.post), "Plan", _ICON.ROUTE),
    PanelEntry("flight", lambda page: FlightPanel(page.server, page.post), "Fly", _ICON.DRONE),
    PanelEntry("estimate", lambda page: EstimatePanel(page.server, page.post), "Estimate", _ICON.FOCUS_2),
    PanelEntry("runs", lambda page: RunsPanel(page.server, page.post), "Runs", _ICON.HISTORY),
    PanelEntry("experiments", lambda page: ExperimentsPanel(page.server, page.post), "Experiments", _ICON.FLASK),
    PanelEntry("export", lambda page: ExportPanel(page.server, page.post), "Export", _ICON.DOWNLOAD),
    PanelEntry("map", lambda page: MapPanel(page.server, page.post), "Export"),
))  # fmt: skip
"""Name to panel, in the order of the page; a tab is where its first panel is."""


def register(entry: PanelEntry) -> None:
    """Put a panel on every page from now on. Raises NameTakenError where another one has its name."""
    PANELS.register(entry)


def panels(page: Page) -> tuple[Panel, ...]:
    """Put up all panels."""
    made = [entry.make(page) for entry in PANELS.values() if entry.tab is None]
    group = page.server.gui.add_tab_group()
    tabs: dict[str, viser.GuiTabHandle] = {}
    for entry in PANELS.values():
        if entry.tab is None:
            continue
        if entry.tab not in tabs:
            tabs[entry.tab] = group.add_tab(entry.tab, entry.icon)
        with tabs[entry.tab]:
            made.append(entry.make(page))
    return tuple(made)

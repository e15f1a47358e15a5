"""The panels of the page: what is happening always at the top, everything else in tabs, in the order of use.

A new panel is a file beside this one and a line in PANELS; `register` adds one from outside before the page is put up.
"""

import viser

from nerfnav.registry import Registry
from nerfnav_app.page.panels import (
    camera,
    command_palette,
    ends,
    estimate,
    experiments,
    export,
    flight,
    kept_places,
    place,
    placing,
    plan,
    robot,
    runs,
    screenshot,
    status,
    timeline,
    track,
    view_settings,
)
from nerfnav_app.page.panels import map as map_panel
from nerfnav_app.page.panels.panel import Page, Panel, PanelEntry
from nerfnav_app.places.track_sources import TrackSources

_ICON = viser.Icon

PANELS: Registry[PanelEntry] = Registry("panel", (
    PanelEntry("status", lambda page: status.StatusPanel(page.server, page.post)),
    PanelEntry("timeline", lambda page: timeline.TimelinePanel(page.server, page.post)),
    PanelEntry("camera", lambda page: camera.CameraPanel(page.server)),
    PanelEntry("command palette", lambda page: command_palette.CommandPalette(page.server, page.post)),
    PanelEntry("place", lambda page: place.PlacePanel(page.server, page.post, page.library), "Scene", _ICON.MAP_2),
    PanelEntry("kept places", lambda page: kept_places.KeptPlacesPanel(page.server, page.post, page.library), "Scene"),
    PanelEntry("ends", lambda page: ends.EndsPanel(page.server, page.post), "Scene"),
    PanelEntry("robot", lambda page: robot.RobotPanel(page.server, page.post, page.library), "Scene"),
    PanelEntry("placing", lambda page: placing.PlacingPanel(page.server, page.post), "Scene"),
    PanelEntry("view settings", lambda page: view_settings.ViewSettingsPanel(page.server, page.post), "Scene"),
    PanelEntry("plan", lambda page: plan.PlanPanel(page.server, page.post), "Plan", _ICON.ROUTE),
    PanelEntry("flight", lambda page: flight.FlightPanel(page.server, page.post), "Fly", _ICON.DRONE),
    PanelEntry("estimate", lambda page: estimate.EstimatePanel(page.server, page.post), "Estimate", _ICON.FOCUS_2),
    PanelEntry("track", lambda page: track.TrackPanel(page.server, page.post, TrackSources()), "Estimate"),
    PanelEntry("runs", lambda page: runs.RunsPanel(page.server, page.post), "Runs", _ICON.HISTORY),
    PanelEntry(
        "experiments", lambda page: experiments.ExperimentsPanel(page.server, page.post), "Experiments", _ICON.FLASK
    ),
    PanelEntry("export", lambda page: export.ExportPanel(page.server, page.post), "Export", _ICON.DOWNLOAD),
    PanelEntry("screenshot", lambda page: screenshot.ScreenshotPanel(page.server, page.post), "Export"),
    PanelEntry("map", lambda page: map_panel.MapPanel(page.server, page.post), "Export"),
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

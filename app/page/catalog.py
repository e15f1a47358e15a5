"""Catalog of the page: all layers of the 3D scene, and all panels with their tabs.

The status is always at the top; everything else is in tabs, in the order of use. A new layer is a file in `layers/`
and a line in `layers`. A new panel is a file in `panels/` and a line in PANELS; `register` adds one from outside
before the page is built.
"""

import viser

from nerfnav.core.registry import Registry
from nerfnav_app.page.kit.panel import Page, Panel, PanelEntry
from nerfnav_app.page.layers.alignment import AlignmentLayer
from nerfnav_app.page.layers.camera_modes import CameraModesLayer
from nerfnav_app.page.layers.comparison import ComparisonLayer
from nerfnav_app.page.layers.ends import EndsLayer
from nerfnav_app.page.layers.field_backdrop import FieldBackdropLayer
from nerfnav_app.page.layers.flight import FlightLayer
from nerfnav_app.page.layers.global_localization import GlobalLocalizationLayer
from nerfnav_app.page.layers.movers import MoversLayer
from nerfnav_app.page.layers.notices import NoticesLayer
from nerfnav_app.page.layers.obstacles import ObstaclesLayer
from nerfnav_app.page.layers.overlays import OverlaysLayer
from nerfnav_app.page.layers.plan import PlanLayer
from nerfnav_app.page.layers.sightings import SightingsLayer
from nerfnav_app.page.layers.splats import SplatsLayer
from nerfnav_app.page.layers.track import TrackLayer
from nerfnav_app.page.layers.viewpoint import ViewpointLayer
from nerfnav_app.page.panels.flight import camera, estimate, flight, track
from nerfnav_app.page.panels.place import alignment, obstacles, place, place_library, view_settings
from nerfnav_app.page.panels.plan import ends, plan, robot
from nerfnav_app.page.panels.plan import occupancy_map as map_panel
from nerfnav_app.page.panels.runs import experiments, export, runs, screenshot
from nerfnav_app.page.panels.status import command_palette, status, timeline
from nerfnav_app.places.uploads import TrackSources


def layers(page: Page) -> tuple[Panel, ...]:
    """Build all layers but the field's surface, which is there before them."""
    server = page.server
    return (
        AlignmentLayer(server, page.post),  # before the nodes that it hides
        SplatsLayer(server),
        OverlaysLayer(server),
        FieldBackdropLayer(server, page.post),
        EndsLayer(server, page.post),
        ObstaclesLayer(server, page.post),
        MoversLayer(server),
        SightingsLayer(server),
        PlanLayer(server),
        FlightLayer(server),
        CameraModesLayer(server),
        ViewpointLayer(server, page.post),
        ComparisonLayer(server),
        GlobalLocalizationLayer(server),
        TrackLayer(server),
        NoticesLayer(server),
    )


_ICON = viser.Icon

PANELS: Registry[PanelEntry] = Registry("panel", (
    PanelEntry("status", lambda page: status.StatusPanel(page.server, page.post)),
    PanelEntry("timeline", lambda page: timeline.TimelinePanel(page.server, page.post)),
    PanelEntry("camera", lambda page: camera.CameraPanel(page.server)),
    PanelEntry("command palette", lambda page: command_palette.CommandPalette(page.server, page.post)),
    PanelEntry("place", lambda page: place.PlacePanel(page.server, page.post, page.library), "Scene", _ICON.MAP_2),
    PanelEntry(
        "kept places", lambda page: place_library.PlaceLibraryPanel(page.server, page.post, page.library), "Scene"
    ),
    PanelEntry("ends", lambda page: ends.EndsPanel(page.server, page.post), "Scene"),
    PanelEntry("obstacles", lambda page: obstacles.ObstaclesPanel(page.server, page.post), "Scene"),
    PanelEntry("robot", lambda page: robot.RobotPanel(page.server, page.post, page.library), "Scene"),
    PanelEntry("placing", lambda page: alignment.AlignmentPanel(page.server, page.post), "Scene"),
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
    PanelEntry("map", lambda page: map_panel.OccupancyMapPanel(page.server, page.post), "Export"),
))  # fmt: skip
"""Name to panel, in the order of the page; the first panel of a tab sets the tab's position."""


def register(entry: PanelEntry) -> None:
    """Add a panel to every page from now on. Raises NameTakenError where another one has its name."""
    PANELS.register(entry)


def panels(page: Page) -> tuple[Panel, ...]:
    """Build all panels in their tabs."""
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

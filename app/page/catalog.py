"""The layers of the page: what is drawn in the 3D scene.

A new layer is a file beside this one and a line here.
"""

from nerfnav_app.page.kit.panel import Page, Panel
from nerfnav_app.page.layers.alignment import PlacingLayer
from nerfnav_app.page.layers.camera_modes import CameraModesLayer
from nerfnav_app.page.layers.comparison import ComparisonLayer
from nerfnav_app.page.layers.ends import EndsLayer
from nerfnav_app.page.layers.field_backdrop import FieldBackdropLayer
from nerfnav_app.page.layers.flight import FlightLayer
from nerfnav_app.page.layers.global_localization import SearchLayer
from nerfnav_app.page.layers.notices import NoticesLayer
from nerfnav_app.page.layers.overlays import OverlaysLayer
from nerfnav_app.page.layers.plan import PlanLayer
from nerfnav_app.page.layers.splats import SplatsLayer
from nerfnav_app.page.layers.track import TrackLayer
from nerfnav_app.page.layers.viewpoint import ViewpointLayer


def layers(page: Page) -> tuple[Panel, ...]:
    """Put up all layers but the field's surface, which is there before them."""
    server = page.server
    return (
        SplatsLayer(server),
        OverlaysLayer(server),
        FieldBackdropLayer(server, page.post),
        EndsLayer(server, page.post),
        PlanLayer(server),
        FlightLayer(server),
        CameraModesLayer(server),
        ViewpointLayer(server, page.post),
        ComparisonLayer(server),
        SearchLayer(server),
        TrackLayer(server),
        PlacingLayer(server),
        NoticesLayer(server),
    )

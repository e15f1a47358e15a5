"""The page: all that is put up on it once everything is imported."""

from collections.abc import Callable

from nerfnav_app.page.catalog import layers
from nerfnav_app.page.icon_archive import icons_at_hand
from nerfnav_app.page.kit.panel import Page, Panel
from nerfnav_app.page.kit.theme import apply_theme
from nerfnav_app.page.layers.field_surface import FieldSurfaceLayer
from nerfnav_app.page.panels.tabs import panels
from nerfnav_app.places.library import PlaceLibrary
from nerfnav_app.state.actions import Command


def put_up(
    surface: FieldSurfaceLayer, post: Callable[[Command], None], library: PlaceLibrary
) -> tuple[Panel, ...]:
    """Put up all layers and panels, in place of what was seen at first: the surface, on whose server the page is."""
    page = Page(surface.server, post, library)
    page.server.gui.reset()
    apply_theme(page.server)
    drawn = layers(page)
    with icons_at_hand():
        return (surface, *drawn, *panels(page))

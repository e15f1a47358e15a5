"""Page: build all layers and panels once everything is imported.

Widgets take their icons from one open archive: viser alone lists an archive of thousands anew for each icon that it
has not shown yet.
"""

import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from types import SimpleNamespace

from viser import _icons

from nerfnav_app.page.catalog import layers, panels
from nerfnav_app.page.kit.panel import Page, Panel
from nerfnav_app.page.kit.theme import apply_theme
from nerfnav_app.page.layers.field_surface import FieldSurfaceLayer
from nerfnav_app.places.library import PlaceLibrary
from nerfnav_app.state.actions import Command


@contextmanager
def icons_at_hand() -> Iterator[None]:
    """Keep viser's archive of icons open for the widgets that are made inside the block."""
    with zipfile.ZipFile(_icons.ICONS_DIR / "tabler-icons.zip") as archive:
        _icons.zipfile = SimpleNamespace(ZipFile=lambda _: nullcontext(archive))  # type: ignore[assignment]
        try:
            yield
        finally:
            _icons.zipfile = zipfile  # type: ignore[attr-defined]


def build_page(surface: FieldSurfaceLayer, post: Callable[[Command], None], library: PlaceLibrary) -> tuple[Panel, ...]:
    """Build all layers and panels on the server of the surface, in place of the splash page."""
    page = Page(surface.server, post, library)
    page.server.gui.reset()
    apply_theme(page.server)
    drawn = layers(page)
    with icons_at_hand():
        return (surface, *drawn, *panels(page))

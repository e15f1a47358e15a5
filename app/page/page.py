"""Page: put up all layers and panels once everything is imported.

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
    """Let widgets that are made inside the block take their icons out of one open archive."""
    with zipfile.ZipFile(_icons.ICONS_DIR / "tabler-icons.zip") as archive:
        _icons.zipfile = SimpleNamespace(ZipFile=lambda _: nullcontext(archive))  # type: ignore[assignment]
        try:
            yield
        finally:
            _icons.zipfile = zipfile  # type: ignore[attr-defined]


def build_page(
    surface: FieldSurfaceLayer, post: Callable[[Command], None], library: PlaceLibrary
) -> tuple[Panel, ...]:
    """Put up all layers and panels, in place of what was seen at first: the surface, on whose server the page is."""
    page = Page(surface.server, post, library)
    page.server.gui.reset()
    apply_theme(page.server)
    drawn = layers(page)
    with icons_at_hand():
        return (surface, *drawn, *panels(page))

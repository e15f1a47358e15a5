"""Splash page: a title and the stored surface of the place, shown until the page is put up.

Imports nothing slow: a surface that was kept is shown while all else is being imported.
"""

import viser

from nerfnav_app.page.kit.html import heading
from nerfnav_app.page.kit.theme import apply_theme
from nerfnav_app.page.layers.field_surface import FieldSurfaceLayer


def show_splash(server: viser.ViserServer, surface: bytes | None) -> FieldSurfaceLayer:
    """Show a title and the surface of the place, where it is known."""
    apply_theme(server)
    server.gui.add_html(heading("nerfnav", "Starting…"))
    return FieldSurfaceLayer(server, surface)

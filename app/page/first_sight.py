"""What is seen of the page at first.

Imports nothing slow: a surface that was kept is shown while all else is being imported.
"""

import viser

from nerfnav_app.page.html import heading
from nerfnav_app.page.layers.field_surface import FieldSurfaceLayer
from nerfnav_app.page.theme import apply_theme


def first_sight(server: viser.ViserServer, surface: bytes | None) -> FieldSurfaceLayer:
    """Show the surface of the place, where it is known, and that more is to come."""
    apply_theme(server)
    server.gui.add_html(heading("nerfnav", "Starting…"))
    return FieldSurfaceLayer(server, surface)

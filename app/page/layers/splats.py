"""Gaussian splats: the source of a field, drawn by the browser's splat renderer."""

import numpy as np
import viser

from nerfnav.importers import Splats
from nerfnav.importers.splats.gaussians import fit_half_precision
from nerfnav_app.page.layers.field_surface import lay
from nerfnav_app.state.session import Session
from nerfnav_app.state.view import Backdrop


class SplatsLayer:
    """Layer of a place's splats, where it has any, in place of the field's surface."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._shown: Splats | None = None
        self._node: viser.GaussianSplatHandle | None = None

    def show(self, session: Session) -> None:
        """Send the splats once they are selected, as they are large, and hide them otherwise."""
        splats = session.place.splats if session.place is not None else None
        wanted = splats is not None and session.view_settings.backdrop is Backdrop.SPLATS
        if self._node is not None and self._shown is not splats:  # another place was opened
            self._node.remove()
            self._node = self._shown = None
        if splats is not None and wanted and self._node is None:
            self._shown = splats
            self._node = self._server.scene.add_gaussian_splats("/splats", *arrays(splats))
        if self._node is not None:
            self._node.visible = wanted
            lay(self._node, session.alignment.now)


def arrays(splats: Splats) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Convert splats to centres (n, 3), covariances (n, 3, 3), colours (n, 3) and opacities (n, 1) for a browser.

    Browsers take covariances in half precision: values beyond its range are clamped.
    """
    return splats.centers, fit_half_precision(splats.covariances), splats.rgbs, splats.opacities[:, None]

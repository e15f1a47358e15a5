"""The field as a surface, and the first view of it."""

import numpy as np
import viser

from app.look import Backdrop
from app.session import Session
from app.surface import dressed
from nerfnav.geometry.box import Box


class SceneLayer:
    """Shows the field's surface, unlit, as its light is in its colours."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._shown: tuple[bytes | None, float, float] | None = None
        self._node: viser.GlbHandle | None = None
        self._framed: Box | None = None

    def show(self, session: Session) -> None:
        """Add the surface once it is there, and look at the box once it is known."""
        if session.place is not None and self._framed is not session.place.field.box:
            self._framed = session.place.field.box
            frame(self._server, self._framed)
        look, surface = session.look, session.surface
        if self._shown != (surface, look.opacity, look.clip):
            self._shown = surface, look.opacity, look.clip
            self._draw(None if surface is None else dressed(surface, look.opacity, look.clip))
        if self._node is not None:
            self._node.visible = look.backdrop is Backdrop.SURFACE

    def _draw(self, glb: bytes | None) -> None:
        if glb is None:  # another place is being opened
            if self._node is not None:
                self._node.remove()
            self._node = None
        elif self._node is None:
            self._node = self._server.scene.add_glb("/field", glb, cast_shadow=False, receive_shadow=False)
        else:
            self._node.glb_data = glb


def frame(server: viser.ViserServer, box: Box) -> None:
    """Let everyone look at the box from above one corner."""
    center, size = box.center.numpy().astype(float), box.size.numpy().astype(float)
    reach = float(np.linalg.norm(size))
    eye = center + reach * np.array([-0.31, -0.60, 0.57])
    # low places leave room above them for plans; tall ones stand in the middle
    target = center + reach * np.array([0.03, 0.05, 0]) - np.array([0, 0, min(0.6 * size[2], 0.13 * reach)])
    server.initial_camera.position = eye
    server.initial_camera.look_at = target
    server.initial_camera.fov = float(np.deg2rad(45))
    for client in server.get_clients().values():
        client.camera.position, client.camera.look_at = eye, target
        client.camera.fov = float(np.deg2rad(45))

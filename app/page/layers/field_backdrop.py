"""Rendered backdrop: the field itself behind the scene of each tab, rendered from that tab's own camera."""

from collections.abc import Callable

import numpy as np
import viser

from nerfnav_app.page.kit.theme import night
from nerfnav_app.queries.field_view import FieldView, FieldViewQuery
from nerfnav_app.state.actions import Command
from nerfnav_app.state.session import Session
from nerfnav_app.state.view import Backdrop, CameraMoved, Eye, TabClosed, to_point


class FieldBackdropLayer:
    """Layer of the rendered field: reports the cameras of tabs while it is shown, and shows the renderings."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """`post` takes the cameras of tabs."""
        self._server, self._post = server, post
        self._watching = False
        self._shown: dict[int, FieldView] = {}
        server.on_client_connect(self._watch)
        server.on_client_disconnect(self._forget)

    def _watch(self, client: viser.ClientHandle) -> None:
        @client.camera.on_update
        async def _(camera: viser.CameraHandle) -> None:
            if self._watching:
                self._post(CameraMoved(client.client_id, eye_of(camera)))

    def _forget(self, client: viser.ClientHandle) -> None:
        self._post(TabClosed(client.client_id))

    def show(self, session: Session) -> None:
        """Show the last rendering of each tab, or restore the common backdrop."""
        wanted = session.view_settings.backdrop is Backdrop.RENDER
        clients = self._server.get_clients()
        if wanted and not self._watching:
            for number, client in clients.items():
                self._post(CameraMoved(number, eye_of(client.camera)))
        if self._watching and not wanted:
            for client in clients.values():
                client.scene.set_background_image(night(), format="png")
            self._shown.clear()
        self._watching = wanted
        if not wanted:
            return
        for number, client in clients.items():
            view = FieldViewQuery.result_in(session, (FieldViewQuery, number))
            if view is not None and self._shown.get(number) is not view:
                self._shown[number] = view
                client.scene.set_background_image(view.image, format="jpeg", jpeg_quality=85, depth=view.depth)


def eye_of(camera: viser.CameraHandle) -> Eye:
    """Convert the camera of a tab."""
    qw, qx, qy, qz = np.asarray(camera.wxyz, np.float64).tolist()
    return Eye(to_point(camera.position), (qw, qx, qy, qz), float(camera.fov), float(camera.aspect))

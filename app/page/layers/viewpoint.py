"""Viewpoint of a tab: reported once its camera rests, and restored by the next server."""

import asyncio
from collections.abc import Callable

import viser

from nerfnav_app.places.vantage import View
from nerfnav_app.state.actions import Command
from nerfnav_app.state.session import Session
from nerfnav_app.state.view import CameraMode, CameraRested, to_point

_REST_S = 0.5
"""Time without a move after which a camera rests: not every frame of a turn is reported."""


class ViewpointLayer:
    """Layer that reports cameras that users turn themselves."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """`post` takes the views."""
        self._post = post
        self._free = False
        self._moves = 0
        server.on_client_connect(self._watch)

    def show(self, session: Session) -> None:
        """Report while cameras are free: the other modes move them without the user."""
        self._free = session.place is not None and session.view_settings.camera is CameraMode.FREE

    def _watch(self, client: viser.ClientHandle) -> None:
        @client.camera.on_update
        async def _(camera: viser.CameraHandle) -> None:
            self._moves += 1
            if self._free:
                asyncio.get_running_loop().call_later(_REST_S, self._rested, camera, self._moves)

    def _rested(self, camera: viser.CameraHandle, moves: int) -> None:
        """Runs on the server's event loop."""
        if self._free and moves == self._moves:
            self._post(CameraRested(view_of(camera)))


def view_of(camera: viser.CameraHandle) -> View:
    """Read eye and target of a tab's camera [m]."""
    return to_point(camera.position), to_point(camera.look_at)

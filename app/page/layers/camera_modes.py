"""Camera modes: chase camera, the robot's own camera, and the view from above."""

import numpy as np
import viser

from nerfnav.geometry import Box
from nerfnav.robots import RigidState, Robot
from nerfnav_app.page.layers.field_surface import first_view, look
from nerfnav_app.state.session import Session
from nerfnav_app.state.view import CameraMode

_WIDE = float(np.deg2rad(75))  # [rad]: what is near is seen whole
_BEHIND, _OVER, _AHEAD = 7.0, 3.0, 10.0  # of the chase camera, in body lengths


class CameraModesLayer:
    """Layer that moves the cameras of all tabs with the shown robot, or with the start where nothing has flown."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._mode = CameraMode.FREE
        self._shown: object = None

    def show(self, session: Session) -> None:
        """Set the camera of the mode; a free camera is reset once, and then left alone."""
        place, mode = session.place, session.view_settings.camera
        if place is None:
            return
        box, changed, self._mode = place.field.box, mode is not self._mode, mode
        if mode is CameraMode.FREE:
            if changed:
                look(self._server, session.view or first_view((box.lower.tolist(), box.upper.tolist())))
            return
        flight = session.shown_flight
        state = flight.steps[-1].truth if flight is not None and flight.steps else session.ends.start.state()
        # the view from above does not go with the robot, and may be turned by hand
        if not changed and (state is self._shown or mode is CameraMode.TOP):
            return
        self._shown = state if flight is not None and flight.steps else None
        eye, target = compute_view(mode, state, place.robot, box)
        for client in self._server.get_clients().values():
            with client.atomic():
                client.camera.position, client.camera.look_at, client.camera.fov = eye, target, _WIDE


def compute_view(mode: CameraMode, state: RigidState, robot: Robot, box: Box) -> tuple[np.ndarray, np.ndarray]:
    """Compute eye and target of a mode's camera, both (3,) [m]."""
    at = state.position.detach().double().numpy()
    forward = state.rotation.detach().double().numpy()[:, 0]
    length = 2 * robot.body.radius
    if mode is CameraMode.ROBOT:
        eye = at + 0.6 * length * forward  # before its own nose
        return eye, eye + forward
    if mode is CameraMode.CHASE:
        level = np.array([forward[0], forward[1], 0.0]) / max(np.hypot(*forward[:2]), 1e-6)
        return at - _BEHIND * length * level + np.array([0, 0, _OVER * length]), at + _AHEAD * length * level
    center, size = box.center.double().numpy(), box.size.double().numpy()
    reach = 0.62 * max(size[0], size[1]) / np.tan(0.5 * _WIDE) + 0.5 * size[2]
    # a hair beside the vertical, where a camera has no up
    return center + np.array([0, -0.01 * reach, reach]), center

"""Camera track: its path, the covariances of its latest poses, and the frustum of the camera now."""

from itertools import pairwise

import numpy as np
import torch
import viser

from nerfnav.geometry import Pose
from nerfnav_app.page.kit.theme import BELIEF
from nerfnav_app.page.layers.global_localization import frusta
from nerfnav_app.page.layers.nodes import THROUGH, Bodies, Fan
from nerfnav_app.page.layers.shapes import ball, ellipsoids
from nerfnav_app.state.session import Session
from nerfnav_app.state.tracks import TrackRecord

_RECENT = 40
"""Number of frames whose ellipsoids are drawn: more would hide one another."""


class TrackLayer:
    """Layer of a camera track up to the time that the timeline shows."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        # the second one is drawn, faintly, over what hides the first
        self._paths = [Fan(server, f"/track/path{ending}", BELIEF, 0.01) for ending in ("", THROUGH)]
        self._regions = Bodies(server, "/track/covariance", BELIEF, 0.3, ball())
        self._camera = Fan(server, "/track/camera", BELIEF, 0.008)
        self._shown: tuple[TrackRecord | None, float] = None, 0.0

    def show(self, session: Session) -> None:
        """Draw the track, or hide it."""
        track, scale = session.shown_track, session.view_settings.ellipsoid
        if track is self._shown[0] and scale == self._shown[1]:
            return
        self._shown = track, scale
        steps = () if track is None else tuple(step.tracked for step in track.steps)
        beliefs = [step.belief for step in steps[-_RECENT:] if step.belief is not None]
        centers, wxyzs, half = ellipsoids(beliefs)
        last = steps[-1].pose if steps else None
        with self._server.atomic():
            for fan in self._paths:
                fan.show(path([step.pose for step in steps]))
            self._regions.show(centers, wxyzs, scale * half)
            self._camera.show(None if last is None else frusta(Pose(last.rotation[None], last.position[None])))


def path(poses: list[Pose | None]) -> np.ndarray | None:
    """Build segments (n, 2, 3) [m] from each pose to the next, where both are known."""
    pairs = [(one.position, two.position) for one, two in pairwise(poses) if one and two]
    return torch.stack([torch.stack(pair) for pair in pairs]).numpy() if pairs else None

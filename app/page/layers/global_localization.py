"""Global localization: candidate poses as ghosts of the robot, with camera frusta and probabilities."""

import numpy as np
import torch
import viser

from nerfnav.estimator import RelocaliseOutcome
from nerfnav.geometry import Pose
from nerfnav.geometry.so3 import quaternion_from_matrix
from nerfnav_app.page.kit.theme import CANDIDATE
from nerfnav_app.page.layers.nodes import Bodies, Fan
from nerfnav_app.state.flight import LocalizationRecord
from nerfnav_app.state.session import Session

MOST_CANDIDATES = 5
"""Most candidates of a finished search that have labels."""
_MOST_FRUSTA = 24  # more would hide the place
_DEPTH = 0.15  # of a drawn frustum [m]
_CORNERS = torch.tensor([[x, y, -1.0] for x, y in ((1, 1), (1, -1), (-1, -1), (-1, 1))])  # at 90 degrees
_LEAST_LIKELY = 0.01  # of what has a label
_ABOVE = 0.06  # a label over its body [m]


class GlobalLocalizationLayer:
    """Layer of the candidates of a global localization, near the time step of the flight whose picture it used."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._ghosts = Bodies(server, "/search/ghosts", CANDIDATE, opacity=0.45)
        self._frusta = Fan(server, "/search/frusta", CANDIDATE, 0.004)
        self._labels = [
            server.scene.add_label(f"/search/label/{index}", "", visible=False, anchor="bottom-center")
            for index in range(MOST_CANDIDATES)
        ]
        self._shown: LocalizationRecord | None = None

    def show(self, session: Session) -> None:
        """Draw the candidates, or nothing."""
        search, flight = session.search, session.shown_flight
        if search is not None and not search.is_visible_at(len(flight.steps) if flight is not None else 0):
            search = None
        if search is self._shown:
            return
        self._shown = search
        with self._server.atomic():
            self._ghosts.embody(session)
            self._draw(search)

    def _draw(self, search: LocalizationRecord | None) -> None:
        if search is None:
            self._ghosts.show_states(None)
            self._frusta.show(None)
        else:
            step = search.step
            bodies = step.body_poses()
            wxyzs = quaternion_from_matrix(bodies.rotation)
            self._ghosts.show(bodies.position.numpy().astype(np.float32), wxyzs.numpy().astype(np.float32))
            self._frusta.show(frusta(step.poses) if len(step.weights) <= _MOST_FRUSTA else None)
        ended = search is not None and search.outcome not in (None, RelocaliseOutcome.LOST)
        shown = search.step if search is not None and ended else None
        for index, label in enumerate(self._labels):
            # the panel's table has the unlikely ones: here they would cover the likely
            share = shown.weights[index].item() if shown is not None and index < len(shown.weights) else 0.0
            label.visible = share >= _LEAST_LIKELY and shown is not None
            if shown is not None and label.visible:
                label.text = f"{index + 1}: {100 * share:.0f} %"
                label.position = tuple((shown.poses.position[index] + torch.tensor([0.0, 0.0, _ABOVE])).tolist())


def frusta(poses: Pose) -> np.ndarray:
    """Build the edges (8 n, 2, 3) [m] of the frusta of cameras (n,)."""
    rims = poses.position[:, None] + _DEPTH * _CORNERS @ poses.rotation.transpose(-1, -2)
    rays = torch.stack([poses.position[:, None].expand_as(rims), rims], 2)
    sides = torch.stack([rims, rims.roll(-1, 1)], 2)
    return torch.cat([rays, sides], 1).flatten(0, 1).numpy()

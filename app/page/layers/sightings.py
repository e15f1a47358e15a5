"""Sightings: boxes in which a robot that watches suspects something that its map does not show."""

import numpy as np
import viser

from nerfnav.obstacles import BoxShape
from nerfnav_app.page.kit.theme import HIT
from nerfnav_app.page.layers.nodes import Bodies
from nerfnav_app.page.layers.obstacles import attitude_of
from nerfnav_app.page.layers.shapes import Shape
from nerfnav_app.state.session import Session

NODE = "/sightings"
_FAINT = 0.2
"""Opacity of a box: many lie in each other, one for each size that the thing may have."""


class SightingsLayer:
    """Layer of what the robot of the shown flight sees beside its map."""

    def __init__(self, server: viser.ViserServer) -> None:
        """Add the boxes, hidden."""
        mesh = BoxShape((1.0, 1.0, 1.0)).mesh()
        cube = Shape(np.asarray(mesh.vertices, np.float32), np.asarray(mesh.faces, np.uint32))
        self._boxes = Bodies(server, NODE, HIT, _FAINT, cube)
        self._shown: object = None

    def show(self, session: Session) -> None:
        """Draw the boxes at the time that the timeline shows."""
        flight = session.shown_flight if session.flight_is_shown else None
        step = flight.steps[-1] if flight is not None and flight.steps else None
        if step is self._shown:
            return
        self._shown = step
        movers = None if step is None else step.seen_movers
        found = () if step is None or movers is None else movers.obstacles
        now = np.array([0.0 if step is None else step.time])
        centers = np.array([obstacle.place(now)[0] for obstacle in found], np.float32).reshape(-1, 3)
        extents = [obstacle.shape.extents for obstacle in found if isinstance(obstacle.shape, BoxShape)]
        attitudes = np.array([attitude_of(obstacle) for obstacle in found], np.float32).reshape(-1, 4)
        self._boxes.show(centers, attitudes, np.array(extents, np.float32).reshape(-1, 3))

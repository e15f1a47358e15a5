"""Query for the position to which a click into the scene moves an end."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import torch

from nerfnav.field import Field, UnknownSpace, render_rays
from nerfnav.planner import OccupancyConfig, fits, nearest_free_pose
from nerfnav_app.places.derived import build_occupancy, prepare_place
from nerfnav_app.places.ends import End, EndRole
from nerfnav_app.queries.query import Query, Resources
from nerfnav_app.reducers.common import add_notice, move_end
from nerfnav_app.state.alignment import Ray, Vector
from nerfnav_app.state.place import Click
from nerfnav_app.state.session import Session

LEAST_OPACITY = 0.5
"""Opacity of a ray that meets a surface."""
_ROOM_M = 0.05  # kept below the body


def intersect_ray(field: Field, ray: Ray) -> Vector | None:
    """Find the point [m] at which a ray meets a surface; None without one."""
    start, along = torch.tensor(ray.origin), torch.nn.functional.normalize(torch.tensor(ray.direction), dim=0)
    rendering = render_rays(field, start[None], along[None])
    if rendering.opacity.item() < LEAST_OPACITY:
        return None
    x, y, z = (start + rendering.depth.item() * along).tolist()
    return x, y, z


@dataclass(frozen=True)
class ClickLandingQuery(Query[Vector | None]):
    """Query for the position [m] of an end that is put where a click points; None without a surface there."""

    click: Click
    unknown: UnknownSpace = UnknownSpace.OCCUPIED
    """Treatment of unseen space."""

    @classmethod
    def pending(cls, session: Session) -> Iterator["ClickLandingQuery"]:
        """Ask while an end waits for its click."""
        if session.clicked is not None and isinstance(session.clicked.which, EndRole):
            yield cls(session.clicked, session.plan_settings.unknown)

    def answer(self, resources: Resources) -> Vector | None:
        """Find the position above the surface that the ray of the click meets, or beside it."""
        met = intersect_ray(resources.place.field, self.click.ray)
        if met is None:
            return None
        place, body = prepare_place(resources.place, self.unknown), resources.place.robot.body
        # as high above it as the body and what it keeps clear of
        above = met[0], met[1], met[2] + 0.5 * body.extents[2] + _ROOM_M
        threshold = build_occupancy(place, OccupancyConfig(), above[2]).scales.threshold
        if fits(place.field, body, End(above).state(), threshold):
            return above
        # the nearest free point in front of a side, toward the eye of the click
        towards = np.array(self.click.ray.direction) / np.linalg.norm(self.click.ray.direction)
        x, y, z = (np.array(met) - (body.radius + _ROOM_M) * towards).tolist()
        occupancy = build_occupancy(place, OccupancyConfig(), z)
        nearest = nearest_free_pose(place.field, body, End((x, y, z)).state(), occupancy)
        return above if nearest is None else End.of_state(nearest).position

    def apply(self, session: Session, result: Vector | None) -> Session:
        """Move the end there, unless another click came."""
        which = self.click.which
        if session.place is None or session.clicked != self.click or not isinstance(which, EndRole):
            return session
        done = replace(session, clicked=None)
        if result is None:
            return add_notice(done, "Nothing there", f"The click met nothing to put the {which.value} on.", bad=True)
        return move_end(done, session.place, which, End(result, session.ends.of(which).yaw))

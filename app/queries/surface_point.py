"""Query for the point of the place that a click points at, and for the floor of the place."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import torch

from nerfnav.core.errors import NerfnavError
from nerfnav.importers import compute_alignment
from nerfnav_app.queries.click_landing import intersect_ray
from nerfnav_app.queries.query import Query, Resources
from nerfnav_app.reducers.common import add_notice
from nerfnav_app.reducers.place import correct_place, show_all
from nerfnav_app.state.alignment import Correction, Ray, TakePoint, Vector
from nerfnav_app.state.session import Session
from nerfnav_app.text import sentence


@dataclass(frozen=True)
class SurfacePointQuery(Query[Vector | None]):
    """Query for the point [m] at which the ray of an alignment click meets the place; None where it meets nothing."""

    ray: Ray
    """Ray in the place as it is shown."""
    now: Correction
    """Correction that it is shown with."""

    @classmethod
    def pending(cls, session: Session) -> Iterator["SurfacePointQuery"]:
        """Ask while a click waits for its point."""
        if session.alignment.clicked is not None:
            yield cls(session.alignment.clicked, session.alignment.now)

    def answer(self, resources: Resources) -> Vector | None:
        """Intersect the ray with the surface, and say where that is shown."""
        met = intersect_ray(resources.place.field, self.now.ray_before(self.ray))
        return None if met is None else self.now.point_after(met)

    def apply(self, session: Session, result: Vector | None) -> Session:
        """Add the point, unless another click came."""
        placing = session.alignment
        if session.place is None or placing.clicked != self.ray or placing.pointing is None:
            return session
        if result is None:
            done = replace(session, alignment=replace(placing, clicked=None))
            return add_notice(done, "Nothing there", "The click met nothing: click at a surface.", bad=True)
        return correct_place(session, session.place, TakePoint(result))


@dataclass(frozen=True)
class FloorQuery(Query[Correction | str]):
    """Query for the correction that levels the place by the floor that is found in it; a sentence where none is."""

    now: Correction
    """The correction so far."""

    @classmethod
    def pending(cls, session: Session) -> Iterator["FloorQuery"]:
        """Ask while the floor is searched."""
        if session.alignment.finding:
            yield cls(session.alignment.now)

    def answer(self, resources: Resources) -> Correction | str:
        """Fit the floor to the surface of the field."""
        from nerfnav_app.jobs.field.georeference import find_surface  # slow to import, and seldom needed

        field, request = resources.place.field, replace(self.now.request(), find_floor=True, box=None)
        try:
            return self.now.placed(
                compute_alignment(
                    request, field.box, find_surface(field, request), torch.Generator().manual_seed(0)
                ).similarity
            )
        except NerfnavError as error:
            return sentence(str(error))

    def apply(self, session: Session, result: Correction | str) -> Session:
        """Level the place, unless it was corrected otherwise meanwhile."""
        placing = replace(session.alignment, finding=False)
        if session.place is None or not session.alignment.finding or placing.now != self.now:
            return session
        if isinstance(result, str):
            return add_notice(replace(session, alignment=placing), "No floor", result, bad=True)
        return show_all(session, session.place, placing.corrected(result))

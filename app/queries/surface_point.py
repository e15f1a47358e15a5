"""Query for the point of the place that a click points at."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from nerfnav_app.queries.click_landing import intersect_ray
from nerfnav_app.queries.query import Query, Resources
from nerfnav_app.reducers.common import add_notice
from nerfnav_app.state.alignment import Ray, Vector
from nerfnav_app.state.session import Session


@dataclass(frozen=True)
class SurfacePointQuery(Query[Vector | None]):
    """Query for the point at which the ray of an alignment click meets the place; None where it meets nothing."""

    ray: Ray

    @classmethod
    def pending(cls, session: Session) -> Iterator["SurfacePointQuery"]:
        """Ask while a click waits for its point."""
        if session.alignment.clicked is not None:
            yield cls(session.alignment.clicked)

    def answer(self, resources: Resources) -> Vector | None:
        """Intersect the ray with the surface."""
        return intersect_ray(resources.place.field, self.ray)

    def apply(self, session: Session, result: Vector | None) -> Session:
        """Add the point, unless another click came."""
        placing = session.alignment
        if placing.clicked != self.ray or placing.pointing is None:
            return session
        if result is None:
            done = replace(session, alignment=replace(placing, clicked=None))
            return add_notice(done, "Nothing there", "The click met nothing: click at a surface.", bad=True)
        return replace(session, alignment=replace(placing.pointed(result), clicked=None))

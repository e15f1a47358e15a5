"""Query: which point of the place does a click mean?"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from nerfnav_app.queries.click_landing import Vector, intersect_ray
from nerfnav_app.queries.query import Query, Resources
from nerfnav_app.reducers.common import noticed
from nerfnav_app.state.alignment import Ray
from nerfnav_app.state.session import Session


@dataclass(frozen=True)
class SurfacePointQuery(Query[Vector | None]):
    """Where does the ray of a click that measures or shows the floor meet the place? None where it meets nothing."""

    ray: Ray

    @classmethod
    def pending(cls, session: Session) -> Iterator["SurfacePointQuery"]:
        """While a click waits for what it met."""
        if session.placing.clicked is not None:
            yield cls(session.placing.clicked)

    def answer(self, resources: Resources) -> Vector | None:
        """The point [m]."""
        return intersect_ray(resources.place.field, self.ray.origin, self.ray.direction)

    def apply(self, session: Session, result: Vector | None) -> Session:
        """The session with one more point, unless another click came."""
        placing = session.placing
        if placing.clicked != self.ray or placing.pointing is None:
            return session
        if result is None:
            told = replace(session, placing=replace(placing, clicked=None))
            return noticed(told, "Nothing there", "The click met nothing: click at a surface.", bad=True)
        return replace(session, placing=replace(placing.pointed(result), clicked=None))

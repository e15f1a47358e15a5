"""Query for the textured surface, where only its rough colours are shown yet."""

from collections.abc import Generator, Iterator
from dataclasses import dataclass, field, replace

from nerfnav_app.queries.query import LongQuery, Resources
from nerfnav_app.state.job import JobKind
from nerfnav_app.state.session import Session


@dataclass(frozen=True)
class SurfaceTextureQuery(LongQuery[bytes]):
    """Query for the textured surface as binary glTF; empty where the field has none."""

    what: str
    """The place that is open."""
    rough: bytes = field(repr=False, compare=False)
    """The surface that is shown until then."""

    @classmethod
    def pending(cls, session: Session) -> Iterator["SurfaceTextureQuery"]:
        """Ask once the user can begin; plans and flights do not wait for it."""
        idle = session.job is None or session.job.kind is JobKind.OPEN
        if session.surface_is_rough and session.surface is not None and idle and not session.seeking:
            yield cls(session.what, session.surface)

    def steps(self, resources: Resources) -> Generator[None, None, bytes]:
        """Bake the texture, or take the stored one."""
        from nerfnav_app.jobs.export.surface import shape_surface  # slow to import

        return shape_surface(resources.place)

    def apply(self, session: Session, result: bytes) -> Session:
        """Show it, unless the surface has changed since; a field of fog has none."""
        if session.surface is not self.rough:
            return session
        return replace(session, surface=result or None, surface_is_rough=False)

"""Query: what does the surface look like with a texture, where only its rough colours are shown yet?"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

from app.queries.query import Query, Resources
from app.state.job import JobKind
from app.state.session import Session


@dataclass(frozen=True)
class SurfaceTextureQuery(Query[bytes]):
    """What is the surface with its texture? The result is binary glTF."""

    what: str
    """The place that is open."""
    rough: bytes = field(repr=False, compare=False)
    """What is shown of it until then."""

    @classmethod
    def pending(cls, session: Session) -> Iterator["SurfaceTextureQuery"]:
        """Once all is shown that is needed to begin; plans and flights do not wait for it."""
        idle = session.job is None or session.job.kind is JobKind.OPEN
        if session.surface_is_rough and session.surface is not None and idle and not session.seeking:
            yield cls(session.what, session.surface)

    def answer(self, resources: Resources) -> bytes:
        """Bake the texture, or take the one that was kept."""
        from app.jobs.surface import surface_of  # slow to import

        return surface_of(resources.place)

    def apply(self, session: Session, result: bytes) -> Session:
        """The session that shows it, unless another surface was shaped since."""
        if session.surface is not self.rough:
            return session
        return replace(session, surface=result, surface_is_rough=False)

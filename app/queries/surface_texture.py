"""Query for the textured surface, where only its rough colours are shown yet.

It takes seconds, and a user who drags an end meanwhile must not wait: each answer goes one step further.
"""

from collections.abc import Generator, Iterator
from dataclasses import dataclass, field, replace

from nerfnav_app.queries.query import Query, Resources
from nerfnav_app.state.job import JobKind
from nerfnav_app.state.session import Session


@dataclass(frozen=True)
class Baking:
    """State of a texture in progress."""

    going: Generator[None, None, bytes]
    """Its generator, for the worker's thread alone."""
    glb: bytes | None = None
    """The surface with it, as binary glTF, once it is done."""


@dataclass(frozen=True)
class SurfaceTextureQuery(Query[Baking]):
    """Query for the textured surface, one step further."""

    what: str
    """The place that is open."""
    rough: bytes = field(repr=False, compare=False)
    """The surface that is shown until then."""
    steps: int = 0
    """Number of steps that were made."""
    baking: Baking | None = field(default=None, repr=False, compare=False)
    """Texture after these steps; None before the first."""

    @classmethod
    def pending(cls, session: Session) -> Iterator["SurfaceTextureQuery"]:
        """Ask once the user can begin; plans and flights do not wait for it."""
        idle = session.job is None or session.job.kind is JobKind.OPEN
        if session.surface_is_rough and session.surface is not None and idle and not session.seeking:
            last = cls.asked_in(session)
            if last is None or last.rough is not session.surface:
                yield cls(session.what, session.surface)
            else:
                yield replace(last, steps=last.steps + 1, baking=cls.result_in(session))

    def is_answered(self, session: Session) -> bool:
        """Return False: the kept result is that of an earlier step."""
        return False

    def answer(self, resources: Resources) -> Baking:
        """Advance the texture by a step, or take the stored one."""
        from nerfnav_app.jobs.export.surface import shape_surface  # slow to import

        going = shape_surface(resources.place) if self.baking is None else self.baking.going
        try:
            next(going)
        except StopIteration as end:
            return Baking(going, end.value)
        return Baking(going)

    def apply(self, session: Session, result: Baking) -> Session:
        """Show it once it is done, unless the surface has changed since; a field of fog has none."""
        if session.surface is not self.rough:
            return session
        if result.glb is None:
            return super().apply(session, result)
        kept = {slot: pair for slot, pair in session.results.items() if slot != self.slot}
        return replace(session, surface=result.glb or None, surface_is_rough=False, results=kept)

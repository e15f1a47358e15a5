"""Query: what does the surface look like with a texture, where only its rough colours are shown yet?

It takes seconds, and a hand that begins to drag meanwhile must not wait: each answer goes one step further.
"""

from collections.abc import Generator, Iterator
from dataclasses import dataclass, field, replace

from nerfnav_app.queries.query import Query, Resources
from nerfnav_app.state.job import JobKind
from nerfnav_app.state.session import Session


@dataclass(frozen=True)
class Baking:
    """A texture that is being made."""

    going: Generator[None, None, bytes]
    """What makes it; the worker's thread alone goes on with it."""
    glb: bytes | None = None
    """The surface with it, as binary glTF, once it is done."""


@dataclass(frozen=True)
class SurfaceTextureQuery(Query[Baking]):
    """What is the surface with its texture, one step after those that were made?"""

    what: str
    """The place that is open."""
    rough: bytes = field(repr=False, compare=False)
    """What is shown of it until then."""
    steps: int = 0
    """How many were made."""
    baking: Baking | None = field(default=None, repr=False, compare=False)
    """What they were made of; None where there are none."""

    @classmethod
    def pending(cls, session: Session) -> Iterator["SurfaceTextureQuery"]:
        """Once all is shown that is needed to begin; plans and flights do not wait for it."""
        idle = session.job is None or session.job.kind is JobKind.OPEN
        if session.surface_is_rough and session.surface is not None and idle and not session.seeking:
            last = cls.asked_in(session)
            if last is None or last.rough is not session.surface:
                yield cls(session.what, session.surface)
            else:
                yield replace(last, steps=last.steps + 1, baking=cls.result_in(session))

    def answer(self, resources: Resources) -> Baking:
        """Go on with the texture, or take the one that was kept."""
        from nerfnav_app.jobs.export.surface import shape_surface  # slow to import

        going = shape_surface(resources.place) if self.baking is None else self.baking.going
        try:
            next(going)
        except StopIteration as end:
            return Baking(going, end.value)
        return Baking(going)

    def apply(self, session: Session, result: Baking) -> Session:
        """The session that shows it once it is done, unless another surface was shaped since."""
        if session.surface is not self.rough:
            return session
        if result.glb is None:
            return super().apply(session, result)
        kept = {slot: pair for slot, pair in session.results.items() if slot != self.slot}
        return replace(session, surface=result.glb, surface_is_rough=False, results=kept)

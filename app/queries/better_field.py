"""Query for a better field: of a mesh, one that was baked is calibrated, then its colours are learned; of a capture, a
draft is replaced by a trained one.

It takes a minute, and plans and flights do not wait: each answer goes one step further, while nothing else runs, and
each better field replaces the one before it between two plans.
"""

from collections.abc import Generator, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from nerfnav.core.errors import InvalidInputError
from nerfnav.field import TrainStep, VoxelField
from nerfnav_app.jobs.events import JobEvent, Progress
from nerfnav_app.places.sources import BUDGETS_S, QualityName
from nerfnav_app.queries.query import Query, Resources
from nerfnav_app.reducers.common import add_notice
from nerfnav_app.state.job import JobKind
from nerfnav_app.state.session import Session


@dataclass(frozen=True)
class Refinement:
    """State of a refinement in progress."""

    going: Generator[JobEvent | VoxelField, None, None]
    """Its generator, for the worker's thread alone."""
    better: VoxelField | None = None
    """The field of this step, where it is better than the one before it."""
    left_s: float | None = None
    """Time to the trained field, while nothing else is computed [s]; None while unknown."""
    picture: np.ndarray | None = field(default=None, compare=False, repr=False)
    """Picture of the field in training, (height, width, 3), sRGB bytes; None while there is none."""


@dataclass(frozen=True)
class BetterFieldQuery(Query[Refinement]):
    """Query for a better field, one step further."""

    source: Path
    """File or folder that the field was made of."""
    file: Path
    """File of the field."""
    quality: QualityName
    """Quality of the field, which gives the time for its colours."""
    step_count: int = 0
    """Number of steps that were made."""
    refinement: Refinement | None = field(default=None, repr=False, compare=False)
    """Refinement after these steps; None before the first."""

    @classmethod
    def pending(cls, session: Session) -> Iterator["BetterFieldQuery"]:
        """Ask once the user can begin; colours wait until the surface has its texture."""
        place = session.place
        idle = session.job is None or session.job.kind is JobKind.OPEN
        if place is None or place.file is None or not idle or session.seeking:
            return
        source, file, info = Path(session.what).absolute(), place.file.absolute(), place.field.info
        # not a draft that was opened without its capture, or that was georeferenced, and lies elsewhere
        is_draft = info.is_draft and source != file and source.parent == file.parent
        is_baked = place.truth is not None and info.proven_from == "mesh" and not info.iterations
        if not (is_draft or is_baked) or ((is_draft or info.noise_std is not None) and session.surface_is_rough):
            return
        last = cls.asked_in(session)
        if last is None or last.file != place.file:
            yield cls(source, place.file, session.quality)
        else:
            yield replace(last, step_count=last.step_count + 1, refinement=cls.result_in(session))

    def is_answered(self, session: Session) -> bool:
        """Return False: the kept result is that of an earlier step."""
        return False

    def answer(self, resources: Resources) -> Refinement:
        """Advance by a step."""
        before = self.refinement or Refinement(self._begin(resources))
        step = next(before.going)
        if isinstance(step, VoxelField):
            return Refinement(before.going, step)
        if isinstance(step, TrainStep) and step.picture is not None:
            return replace(before, better=None, picture=step.picture)
        return replace(before, better=None, left_s=step.left_s if isinstance(step, Progress) else before.left_s)

    def _begin(self, resources: Resources) -> Generator[JobEvent | VoxelField, None, None]:
        from nerfnav_app.jobs.field import baked, drafts  # slow to import, and seldom needed

        place = resources.place.without_obstacles()
        if place.field.info.is_draft:
            return drafts.refine(self.source, self.file, self.quality, BUDGETS_S[self.quality])
        if place.scene is None or not isinstance(place.field, VoxelField):
            raise InvalidInputError(f"the mesh of {place.name} is missing: its colours cannot be learned")
        return baked.refine(place.field, place.scene, self.file, BUDGETS_S[self.quality])

    def apply(self, session: Session, result: Refinement) -> Session:
        """Take a better field: what was computed in the old one is asked again, plans and flights stay."""
        place, better = session.place, result.better
        if place is None or place.file != self.file:
            return session
        if better is None:
            return super().apply(session, result)
        there = replace(session, place=replace(place.without_obstacles(), field=better))  # they are placed again
        if not better.info.iterations:  # calibrated: it looks the same
            return replace(there, results={self.slot: (self, result)})
        there = replace(there, results={}, surface_is_rough=True)
        if better.info.learned_from == "mesh":
            return add_notice(there, "Better colours", "The field has learned the colours of the mesh.")
        return add_notice(there, "Trained field", "The field has learned all pictures of the capture.")

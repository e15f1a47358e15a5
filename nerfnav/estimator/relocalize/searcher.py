"""Searcher: find a camera in one field, first where its capture's cameras stood, then everywhere."""

from collections.abc import Generator, Iterator
from dataclasses import dataclass, replace
from dataclasses import field as dataclass_field

from torch import Tensor

from nerfnav.core.steps import run_steps
from nerfnav.estimator.photometric.residuals import ColorNoise
from nerfnav.estimator.relocalize.capture_prior import decode_views, list_places_near, list_tilts_near
from nerfnav.estimator.relocalize.global_localization import (
    RelocaliseConfig,
    RelocaliseOutcome,
    RelocaliseStep,
    relocalise,
)
from nerfnav.estimator.relocalize.panorama import PanoramaIndex, find_free_places
from nerfnav.field import Field
from nerfnav.geometry import Camera

_NEAR = 0.5
"""Share of a search that has to go everywhere in the end."""


@dataclass(frozen=True)
class GlobalLocalizer:
    """Finds a camera anywhere in a field (a `Relocaliser`, see navigation/supervisor.py)."""

    field: Field
    """The map."""
    camera: Camera
    """What takes the pictures."""
    noise: ColorNoise
    """How far right colours may be off."""
    config: RelocaliseConfig = dataclass_field(default_factory=RelocaliseConfig)
    """How the search goes."""
    _made: dict[bool, PanoramaIndex] = dataclass_field(default_factory=dict, init=False, repr=False, compare=False)
    """What was looked at so far: whether near to the capture's cameras alone, and what it looks like."""

    @property
    def looks(self) -> PanoramaIndex:
        """The field from everywhere, made when it is first asked for: this takes seconds."""
        return run_steps(self._looking(near=False))

    @property
    def near(self) -> PanoramaIndex | None:
        """The field from where the capture's cameras stood, made likewise; None where nobody knows where that was."""
        return run_steps(self._looking(near=True)) if self.config.views else None

    def prepare(self) -> Iterator[float]:
        """Make what every search begins with; yields the share that is done."""
        yield from self._looking(near=bool(self.config.views))

    def _looking(self, near: bool) -> Generator[float, None, PanoramaIndex]:
        """The field from everywhere, or from near to the capture's cameras, made once."""
        if near not in self._made:
            config, tilts = self.config.looks, None
            if near:
                views = decode_views(self.config.views)
                places, tilts = list_places_near(views), list_tilts_near(views)
            else:
                places = find_free_places(self.field, config.spacing * float(self.field.box.size.max()))
            self._made[near] = yield from PanoramaIndex.looking(self.field, self.camera, places, config, tilts)
        return self._made[near]

    def relocalise(self, image: Tensor) -> Iterator[RelocaliseStep]:
        """Find the pose of the camera that took a picture; see the function of this name.

        Poses near to the capture's come first; where none leads to the picture, the search goes everywhere.
        """
        if self.near is not None:
            step = None
            for step in relocalise(image, self.near, self.noise, self.config.near()):
                found = step.outcome not in (None, RelocaliseOutcome.LOST)
                yield step if found else replace(step, fraction=_NEAR * step.fraction, outcome=None)
                if found:
                    return
            assert step is not None, "a search has at least one step"
            for _ in self._looking(near=False):
                yield replace(step, fraction=_NEAR, outcome=None)
        yield from relocalise(image, self.looks, self.noise, self.config)

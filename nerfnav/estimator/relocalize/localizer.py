"""Global localizer: find a camera in one field, first where its capture's cameras stood, then everywhere."""

from collections.abc import Generator, Iterator
from dataclasses import dataclass, replace
from dataclasses import field as dataclass_field

from torch import Tensor

from nerfnav.core.steps import run_steps
from nerfnav.estimator.photometric.residuals import ColorNoise
from nerfnav.estimator.relocalize.capture_prior import decode_views, list_places_near, list_tilts_near
from nerfnav.estimator.relocalize.global_localization import (
    Relocalisation,
    RelocaliseConfig,
    RelocaliseOutcome,
    relocalise,
    search_panoramas,
)
from nerfnav.estimator.relocalize.panorama import PanoramaIndex, find_free_places
from nerfnav.field import Field
from nerfnav.geometry import Camera

_NEAR = 0.5
"""Share of a search that has to go everywhere in the end."""


@dataclass(frozen=True)
class GlobalLocalizer:
    """Finder of a camera anywhere in a field (a `Relocaliser`, see navigation/supervisor.py)."""

    field: Field
    """Map."""
    camera: Camera
    """Camera of the pictures."""
    noise: ColorNoise
    """Noise of colours at the right pose."""
    config: RelocaliseConfig = dataclass_field(default_factory=RelocaliseConfig)
    """Options of the search."""
    _made: dict[bool, PanoramaIndex] = dataclass_field(default_factory=dict, init=False, repr=False, compare=False)
    """Panoramas rendered so far: near to the capture's cameras (True), everywhere (False)."""

    @property
    def looks(self) -> PanoramaIndex:
        """Panoramas from everywhere, rendered at the first access: this takes seconds."""
        return run_steps(self._render(near=False))

    @property
    def near(self) -> PanoramaIndex | None:
        """Panoramas from where the capture's cameras stood, rendered likewise; None where those poses are unknown."""
        return run_steps(self._render(near=True)) if self.config.views else None

    def prepare(self) -> Iterator[float]:
        """Render the panoramas that every search begins with; yields the share that is done."""
        yield from self._render(near=bool(self.config.views))

    def with_camera(self, camera: Camera) -> "GlobalLocalizer":
        """Return the localizer of another camera, with the panoramas rendered so far."""
        other = GlobalLocalizer(self.field, camera, self.noise, self.config)
        other._made.update({near: index.with_camera(camera) for near, index in self._made.items()})
        return other

    def _render(self, near: bool) -> Generator[float, None, PanoramaIndex]:
        """Render panoramas from everywhere, or from near to the capture's cameras, once."""
        if near not in self._made:
            config, tilts = self.config.looks, None
            if near:
                views = decode_views(self.config.views)
                places, tilts = list_places_near(views), list_tilts_near(views)
            else:
                places = find_free_places(self.field, config.spacing * float(self.field.box.size.max()))
            self._made[near] = yield from PanoramaIndex.render(self.field, self.camera, places, config, tilts)
        return self._made[near]

    def relocalise(self, image: Tensor) -> Relocalisation:
        """Find the pose of the camera that took a picture, without a prediction; see the function of this name.

        Poses near to the capture's come first; where none leads to the picture, the search goes everywhere.
        """
        if self.near is not None:
            found = yield from search_panoramas(image, self.near, self.noise, self.config.near(), _NEAR)
            if found.outcome is not RelocaliseOutcome.LOST:
                yield found.step
                return found
            step = replace(found.step, fraction=_NEAR)
            yield step
            for _ in self._render(near=False):
                yield step
        return (yield from relocalise(image, self.looks, self.noise, self.config))

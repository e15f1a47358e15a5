"""Localize: where was a picture taken?"""

import time
from dataclasses import dataclass, field, replace
from pathlib import Path

from torch import Tensor

from app.jobs.events import JobEvents, JobResult, Progress
from app.jobs.given_picture import GivenCamera, camera_of, read_image
from app.jobs.localize_summary import summary_of
from app.places.opening import field_file
from nerfnav.estimator import ColorNoise, Searcher
from nerfnav.estimator.verdict import check_image
from nerfnav.field import load_field


@dataclass(frozen=True)
class LocalizeRequest:
    """What to find."""

    place: str
    """Name of a bundled scene, or path of a field."""
    image: Path
    """The picture."""
    camera: GivenCamera = field(default_factory=GivenCamera)
    """What is known of its camera."""


def run(request: LocalizeRequest) -> JobEvents:
    """Yield how far the search is; return where the camera most likely was. Raises NerfnavError for bad requests."""
    image = read_image(request.image)
    place = load_field(field_file(request.place))
    camera, told = camera_of(image, request.camera, place.info.camera, request.image)
    found = yield from search(Searcher(place, camera, ColorNoise().measured(place.info.noise_std)), image)
    return replace(found, summary={**found.summary, "camera": told})


def search(searcher: Searcher, image: Tensor) -> JobEvents:
    """Yield how far the search is; return where the camera most likely was."""
    check_image(image, searcher.camera)
    yield Progress("looking around in the field", 0.0)
    begun = time.perf_counter()
    searcher.looks  # noqa: B018 - made here, so that it is timed on its own
    looks_s = time.perf_counter() - begun
    begun, step = time.perf_counter(), None
    for step in searcher.relocalise(image):
        yield step
        yield Progress("comparing", step.fraction)
    assert step is not None, "a search yields at least one step"
    seconds = {"looks_s": looks_s, "search_s": time.perf_counter() - begun}
    return JobResult(summary_of(step) | seconds)

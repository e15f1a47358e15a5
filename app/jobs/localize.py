"""Localize: where was a picture taken?"""

import time
from dataclasses import dataclass
from pathlib import Path

from torch import Tensor

from app.jobs.events import JobEvents, JobResult, Progress
from app.jobs.given_picture import calibrated, camera_of, read_image
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
    fov_deg: float = 90.0
    """Horizontal field of view of its camera [degrees]."""
    intrinsics: tuple[float, float, float, float] | None = None
    """fx, fy, cx, cy [pixels], in place of the field of view."""
    calibration: Path | None = None
    """File of the camera, in place of both."""


def run(request: LocalizeRequest) -> JobEvents:
    """Yield how far the search is; return where the camera most likely was. Raises NerfnavError for bad requests."""
    image = read_image(request.image)
    if request.calibration is not None:
        camera = calibrated(image, request.calibration)
    else:
        camera = camera_of(image, request.fov_deg, request.intrinsics)
    field = load_field(field_file(request.place))
    return (yield from search(Searcher(field, camera, ColorNoise().measured(field.info.noise_std)), image))


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

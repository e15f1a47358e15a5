"""Localize job: global localization of a picture from a file, or of the last picture of the robot's own camera."""

import time
from collections.abc import Generator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from jaxtyping import UInt8
from torch import Tensor

from nerfnav.estimator import ColorNoise, GlobalLocalizer, Relocalisation, RelocaliseConfig, RelocaliseResult
from nerfnav.field import StoredField, load_field
from nerfnav.geometry import Camera, check_image
from nerfnav.geometry.so3 import quaternion_from_matrix, yaw_of
from nerfnav_app.jobs.events import JobEvents, JobResult, Progress
from nerfnav_app.jobs.track.camera import GivenCamera, camera_of, read_image
from nerfnav_app.places.derived import build_searcher
from nerfnav_app.places.place import Place, field_file


def summary_of(result: RelocaliseResult) -> dict[str, Any]:
    """Numbers of `localize --json`: the outcome, and the likeliest poses of the camera's carrier, best first."""
    step = result.step
    poses = step.body_poses()
    found = [
        {
            "position_m": poses.position[index].tolist(),
            "yaw_rad": yaw_of(poses.rotation[index]).item(),
            "quaternion_wxyz": quaternion_from_matrix(poses.rotation[index]).tolist(),
            "weight": step.weights[index].item(),
            "difference": step.differences[index].item(),
        }
        for index in range(len(step.weights))
    ]
    return {"outcome": result.outcome.name.lower(), "advice": result.outcome.value, **found[0], "candidates": found}


_AROUND = 0.5
"""Share of the work that is done once the field was looked at from everywhere."""


@dataclass(frozen=True)
class LocalizeRequest:
    """Request of a localization: field, picture and camera."""

    place: str
    """Name of a bundled scene, or path of a field."""
    image: Path
    """The picture."""
    camera: GivenCamera = field(default_factory=GivenCamera)
    """Given data of its camera."""


def run(request: LocalizeRequest) -> JobEvents:
    """Yield how far the search is; return where the camera most likely was. Raises NerfnavError for bad requests."""
    place = load_field(field_file(request.place))
    image = read_image(request.image, request.camera.aspect(place.info.camera))
    camera, origin = camera_of(image, request.camera, place.info.camera, request.image)
    found = yield from search(searcher_in(place, camera), image)
    return replace(found, summary={**found.summary, "camera": origin})


def searcher_in(field: StoredField, camera: Camera) -> GlobalLocalizer:
    """Make the global localizer of a camera in a field, by all that the field remembers."""
    return GlobalLocalizer(
        field, camera, ColorNoise().measured(field.info.noise_std), RelocaliseConfig().for_field(field.info)
    )


def search(searcher: GlobalLocalizer, image: Tensor) -> JobEvents:
    """Yield how far the search is; return where the camera most likely was."""
    check_image(image, searcher.camera)
    begun = time.perf_counter()
    yield Progress("looking around in the field", 0.0)
    for share in searcher.prepare():  # here, so that it is timed on its own
        yield Progress("looking around in the field", _AROUND * share)
    looks_s = time.perf_counter() - begun
    begun = time.perf_counter()
    result = yield from _with_progress(searcher.relocalise(image))
    yield result
    seconds = {"looks_s": looks_s, "search_s": time.perf_counter() - begun}
    return JobResult(summary_of(result) | seconds)


def _with_progress(search: Relocalisation) -> Generator[Any, Any, RelocaliseResult]:
    while True:
        try:
            step = next(search)
        except StopIteration as end:
            return end.value
        yield step
        yield Progress("comparing", _AROUND + (1 - _AROUND) * step.fraction)


def find(place: Place, image: UInt8[Tensor, "height width 3"]) -> JobEvents:
    """Localize a picture that the robot's own camera has taken in an open place."""
    noise = ColorNoise().measured(place.field.info.noise_std)
    return search(build_searcher(place, place.robot.camera, noise), image)

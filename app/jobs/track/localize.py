"""Localize job: global localization of a picture from a file, or of the last picture of the robot's own camera."""

import math
import time
from collections.abc import Generator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from jaxtyping import UInt8
from torch import Tensor

from nerfnav.estimator import ColorNoise, GlobalLocalizer, RelocaliseConfig, RelocaliseOutcome, RelocaliseResult
from nerfnav.field import load_field
from nerfnav.geometry import check_image
from nerfnav.geometry.so3 import quaternion_from_matrix, yaw_of
from nerfnav.tracking import Sighting, camera_of_photographs, change_to, fit_focal_length
from nerfnav_app.jobs.events import JobEvent, JobEvents, JobResult, Progress, relay_steps
from nerfnav_app.jobs.track.camera import GivenCamera, camera_of, read_image
from nerfnav_app.jobs.track.camera_check import numbers_of_check, require_clear
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
    noise, likely = ColorNoise().measured(place.info.noise_std), camera_of_photographs(place.info, camera)
    searcher, fit = GlobalLocalizer(place, camera, noise, RelocaliseConfig().for_field(place.info)), None
    result, seconds = yield from _search(searcher, image)
    change = change_to(camera, likely) if result.outcome is RelocaliseOutcome.LOST else 0.0
    if change:
        other, _ = yield from _search(searcher.with_camera(camera.magnified(math.exp(change))), image)
        result = other if other.outcome is RelocaliseOutcome.FOUND else result
    if result.outcome is RelocaliseOutcome.FOUND:
        sighting = Sighting(image, result.step.poses[0])
        fit = fit_focal_length(place, camera, [sighting], noise, likely, change)
    if fit is not None and not fit.ok:
        require_clear(fit)
        result, seconds = yield from _search(searcher.with_camera(fit.fitted), image)
        origin = f"{fit.sentence}; it was corrected"
    return JobResult(summary_of(result) | seconds | {"camera": origin, "camera_check": numbers_of_check(fit, camera)})


def search(searcher: GlobalLocalizer, image: Tensor) -> JobEvents:
    """Yield how far the search is; return where the camera most likely was."""
    result, seconds = yield from _search(searcher, image)
    return JobResult(summary_of(result) | seconds)


def _search(
    searcher: GlobalLocalizer, image: Tensor
) -> Generator[JobEvent, bool | None, tuple[RelocaliseResult, dict[str, float]]]:
    """Yield how far the search is; return its result, and how long its parts took [s]."""
    check_image(image, searcher.camera)
    begun = time.perf_counter()
    yield Progress("looking around in the field", 0.0)
    for share in searcher.prepare():  # here, so that it is timed on its own
        yield Progress("looking around in the field", _AROUND * share)
    looks_s = time.perf_counter() - begun
    begun = time.perf_counter()
    result = yield from relay_steps(
        searcher.relocalise(image),
        lambda step: (step, Progress("comparing", _AROUND + (1 - _AROUND) * step.fraction)),
    )
    yield result
    return result, {"looks_s": looks_s, "search_s": time.perf_counter() - begun}


def find(place: Place, image: UInt8[Tensor, "height width 3"]) -> JobEvents:
    """Localize a picture that the robot's own camera has taken in an open place."""
    noise = ColorNoise().measured(place.field.info.noise_std)
    return search(build_searcher(place, place.robot.camera, noise), image)

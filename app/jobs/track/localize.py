"""Localize job: global localization of a picture from a file, or of the last picture of the robot's own camera."""

import time
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from jaxtyping import UInt8
from torch import Tensor

from nerfnav.estimator import ColorNoise, GlobalLocalizer, RelocaliseConfig, RelocaliseResult
from nerfnav.field import load_field
from nerfnav.geometry import check_image
from nerfnav.geometry.so3 import quaternion_from_matrix, yaw_of
from nerfnav_app.jobs.events import JobEvents, JobResult, Progress, relay_steps
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
    noise = ColorNoise().measured(place.info.noise_std)
    found = yield from search(GlobalLocalizer(place, camera, noise, RelocaliseConfig().for_field(place.info)), image)
    return replace(found, summary={**found.summary, "camera": origin})


def search(searcher: GlobalLocalizer, image: Tensor) -> JobEvents:
    """Yield how far the search is; return where the camera most likely was."""
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
    seconds = {"looks_s": looks_s, "search_s": time.perf_counter() - begun}
    return JobResult(summary_of(result) | seconds)


def find(place: Place, image: UInt8[Tensor, "height width 3"]) -> JobEvents:
    """Localize a picture that the robot's own camera has taken in an open place."""
    noise = ColorNoise().measured(place.field.info.noise_std)
    return search(build_searcher(place, place.robot.camera, noise), image)

"""Localize: where was a picture taken?"""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import torch
from jaxtyping import UInt8
from torch import Tensor

from app.jobs.events import JobEvents, JobResult, Progress
from app.jobs.simulated_world import CAMERA
from app.places.derived import searcher_of
from app.places.opening import field_file
from app.places.place import Place
from nerfnav.errors import InvalidInputError
from nerfnav.estimator.photometric import ColorNoise
from nerfnav.estimator.relocalise import RelocaliseStep, Searcher
from nerfnav.estimator.verdict import check_image
from nerfnav.field.checkpoint import load_field
from nerfnav.geometry.camera import Camera
from nerfnav.geometry.so3 import quaternion_from_matrix, yaw_of


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


def run(request: LocalizeRequest) -> JobEvents:
    """Yield how far the search is; return where the camera most likely was. Raises NerfnavError for bad requests."""
    image = read_image(request.image)
    camera = camera_of(request, image)
    field = load_field(field_file(request.place))
    return (yield from _search(Searcher(field, camera, ColorNoise().measured(field.info.noise_std)), image))


def find(place: Place, image: UInt8[Tensor, "height width 3"]) -> JobEvents:
    """The same for a picture that the robot's own camera has taken in an open place."""
    noise = ColorNoise().measured(place.field.info.noise_std)
    return _search(searcher_of(place, CAMERA, noise), image)


def _search(searcher: Searcher, image: Tensor) -> JobEvents:
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


def summary_of(step: RelocaliseStep) -> dict[str, Any]:
    """What `localize --json` prints: the outcome, and the likeliest poses of the camera's carrier, best first."""
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
    assert step.outcome is not None, "the last step of a search has its outcome"
    return {"outcome": step.outcome.name.lower(), "advice": step.outcome.value, **found[0], "candidates": found}


def read_image(path: Path) -> UInt8[Tensor, "height width 3"]:
    """A picture file as RGB. Raises InvalidInputError where it is none."""
    if not path.is_file():
        raise InvalidInputError(f"there is no picture {path}")
    pixels = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if pixels is None:
        raise InvalidInputError(f"{path} cannot be read as a picture: give a PNG or JPEG file")
    return torch.from_numpy(pixels[..., ::-1].copy())


def camera_of(request: LocalizeRequest, image: UInt8[Tensor, "height width 3"]) -> Camera:
    """The camera that took the picture. Raises InvalidInputError for numbers that no camera has."""
    height, width, _ = image.shape
    if request.intrinsics is None:
        return Camera.from_fov(width, height, request.fov_deg)
    fx, fy, cx, cy = request.intrinsics
    if not (fx > 0 and fy > 0):
        raise InvalidInputError(f"focal lengths are above 0 pixels, not {fx:g} and {fy:g}")
    return Camera(width, height, fx, fy, cx, cy)

"""Camera check: fit a camera's focal length to pictures whose poses are roughly known, and compare it with the given.

A wrong focal length hides in the poses: they move along the line of sight until the picture fits about as well. What
is left shows in the cost, so each picture j is aligned anew with focal lengths f exp(x) for several x, which gives the
profile likelihood (Barndorff-Nielsen and Cox 1994, Sec. 3.4)

    J(x) = sum over j of min over pose and exposure of J_j(x)

The least of J is bracketed by steps of `CameraCheckConfig.step`, and lies at the vertex of the parabola through the
least three. Its standard deviation is the larger of that of the curvature, J'' = 2 / s^2, and of the jackknife, which
leaves out one picture after the other (Efron 1982).

A field shows its surfaces a little beside their places, so that the fit errs by about 0.01 in x even for the camera of
the field's own photographs. Where that camera agrees with the fit, it is taken for the one that fits.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from typing import Any

import numpy as np
import torch
from jaxtyping import UInt8
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.estimator import AlignConfig, ColorNoise, Observation, reduce_camera, resize_picture
from nerfnav.estimator.core.filter_config import exposure_prior
from nerfnav.estimator.photometric.direct_alignment import align_picture, draw_spaced_pixels
from nerfnav.estimator.photometric.levenberg_marquardt import Guess, NewtonConfig, Prior, improve
from nerfnav.estimator.photometric.pyramid import View
from nerfnav.estimator.photometric.residuals import count_patches
from nerfnav.field import Field, FieldInfo
from nerfnav.geometry import Camera, Pose
from nerfnav.tracking.frame import Frame, TrackStatus
from nerfnav.tracking.tracker import Tracker

_ITSELF = Pose(torch.eye(3), torch.zeros(3))


@dataclass(frozen=True)
class CameraCheckConfig:
    """Options of the camera check."""

    frames: int = 16
    """Frames that are tracked for the check at most, the first ..."""
    every: int = 2
    """... of which one in so many is compared, where enough remain."""
    tried: tuple[float, ...] = (0.0, -0.1, 0.1, -0.2, 0.2)
    """Logarithms of focal lengths, over the given, with which the camera is searched for until it is found; after the
    first, that of the field's photographs."""
    fewest: int = 4
    """Fewest pictures that show a camera that was not found as it was given, and that a calibration is written from."""
    step: float = 0.05
    """Difference of the logarithms of the focal lengths that are compared."""
    widest: float = 0.4
    """Largest logarithm of a focal length over the given: beyond, none is claimed to fit."""
    tolerated: float = 0.025
    """The given camera is wrong where the fit is further away than this, errors of the field itself [logarithm of the
    focal length] ..."""
    significant: float = 2.0
    """... and so many standard deviations."""
    clear: float = 0.02
    """Largest standard deviation of a fit that is used in place of the given camera [logarithm of the focal length]."""
    pixels: int = 1500
    """Pixels compared at each focal length."""
    iterations: int = 4
    """Steps of the descent on them."""


@dataclass(frozen=True)
class Sighting:
    """Picture from a pose that is roughly known."""

    picture: UInt8[Tensor, "height width 3"]
    """RGB."""
    pose: Pose
    """T_world_camera."""


@dataclass(frozen=True)
class CameraFit:
    """Focal length that fits pictures best."""

    given: Camera
    """Camera as given."""
    change: float
    """x, the logarithm of the fitted over the given focal length."""
    std: float
    """Standard deviation of x; infinite where J has no minimum within the range."""
    gain: float
    """J with the given focal length less J with the fitted: chi-squared of one number where the given is right."""
    pictures: int
    """Pictures that were compared."""
    likely: Camera | None = None
    """Camera of the field's photographs, in its own resolution; None where it is unknown."""
    config: CameraCheckConfig = CameraCheckConfig()
    """Bounds."""

    @property
    def fitted(self) -> Camera:
        """Camera that fits: that of the field's photographs where it agrees with the fit."""
        return self.given.magnified(math.exp(change_to(self.given, self.likely) if self._is_likely else self.change))

    @property
    def ok(self) -> bool:
        """Return True where the given camera differs from the fit by no more than the fit may err."""
        return self._agrees(0.0) or (math.isinf(self.std) and self.gain <= self.config.significant**2)

    @property
    def clear(self) -> bool:
        """Return True where the camera that fits is known well enough to be used."""
        return self.std <= self.config.clear or self._is_likely

    @property
    def sentence(self) -> str:
        """Result for the user."""
        given, fitted = self.given.horizontal_fov_deg, self.fitted.horizontal_fov_deg
        if self.ok:
            return f"the camera's field of view of {given:.1f} degrees fits the field"
        return f"the camera's field of view is {fitted:.1f} degrees, not {given:.1f} as given"

    @property
    def numbers(self) -> dict[str, Any]:
        """Numbers of `camera_check` in `--json`."""
        given, fitted = self.given.horizontal_fov_deg, self.fitted.horizontal_fov_deg
        return {"ok": self.ok, "given_fov_deg": given, "fitted_fov_deg": fitted}

    @property
    def _is_likely(self) -> bool:
        return self.likely is not None and self._agrees(change_to(self.given, self.likely))

    def _agrees(self, change: float) -> bool:
        """Return True where the fit does not rule out this x."""
        if math.isinf(self.std):
            return False
        return abs(self.change - change) <= self.config.tolerated + self.config.significant * self.std


def camera_of_photographs(info: FieldInfo, camera: Camera) -> Camera | None:
    """Return the camera of a field's photographs; None where it is unknown, or has other proportions than `camera`."""
    if info.camera:
        with suppress(InvalidInputError):
            return Camera.of_numbers(info.camera).for_picture(camera.width, camera.height)
    return None


def change_to(given: Camera, other: Camera | None) -> float:
    """Return the logarithm of another camera's focal length over the given, in pictures of one size; 0 for None."""
    return 0.0 if other is None else math.log(other.fx * given.width / other.width / given.fx)


def check_camera(
    tracker: Tracker,
    frames: Callable[[], Iterator[Frame]],
    likely: Camera | None = None,
    config: CameraCheckConfig | None = None,
) -> CameraFit | None:
    """Fit the focal length of a tracker's camera to its first frames; None where it is found in none of them.

    `frames` begins them anew at each call; `likely` is the camera of the field's photographs. The tracker forgets.
    """
    config = CameraCheckConfig() if config is None else config
    first, *others = config.tried
    for change in (first, change_to(tracker.camera, likely), *others):
        trial = tracker.with_camera(tracker.camera.magnified(math.exp(change))) if change else tracker
        trial.forget()
        sightings = [*_sightings(trial, islice(frames(), config.frames))]
        tracker.forget()
        if len(sightings) >= (config.fewest if change else 1):
            if len(sightings) >= config.every * config.fewest:
                sightings = sightings[:: config.every]
            noise = tracker.config.filter.color_noise
            return fit_focal_length(tracker.field, tracker.camera, sightings, noise, likely, change, config)
    return None


def _sightings(tracker: Tracker, frames: Iterator[Frame]) -> Iterator[Sighting]:
    """Yield frames in which the camera is found, until it is searched for in vain, or a frame cannot be read."""
    with suppress(InvalidInputError):  # raised again where the frames are tracked
        for frame in frames:
            tracked = tracker.observe(frame)
            if tracked.status in (TrackStatus.SEARCHING, TrackStatus.LOST):
                return
            if tracked.pose is not None and tracked.status.updated:
                yield Sighting(frame.picture, tracked.pose)


def fit_focal_length(
    field: Field,
    camera: Camera,
    sightings: Sequence[Sighting],
    noise: ColorNoise,
    likely: Camera | None = None,
    start: float = 0.0,
    config: CameraCheckConfig | None = None,
) -> CameraFit:
    """Fit the focal length of a camera to pictures from poses that are roughly known with exp(`start`) times its own.

    Raises InvalidInputError without pictures, and for a picture of other proportions than the camera's.
    """
    if not sightings:
        raise InvalidInputError("a focal length is fitted to pictures, and there is none")
    config = CameraCheckConfig() if config is None else config
    best, most = round(start / config.step), round(config.widest / config.step)
    profile = _Profile(field, camera, sightings, noise, best, config)
    while abs(best) < most:
        near = (best - 1, best, best + 1)
        before, best = best, min(near, key=lambda index: float(profile.costs(index).sum()))
        if best == before:
            change, std = _vertex(np.stack([profile.costs(index) for index in near]), config.step)
            break
    else:
        change, std = 0.0, math.inf
    gain = float((profile.costs(0) - profile.costs(best)).sum())
    return CameraFit(camera, best * config.step + change, std, gain, len(sightings), likely, config)


class _Profile:
    """J_j(x) of all pictures, computed once for each x."""

    def __init__(
        self,
        field: Field,
        camera: Camera,
        sightings: Sequence[Sighting],
        noise: ColorNoise,
        start: int,
        config: CameraCheckConfig,
    ) -> None:
        """Begin with poses that are roughly right at `start` steps."""
        picture = sightings[0].picture
        camera = reduce_camera(camera.for_picture(picture.shape[1], picture.shape[0]))
        self._field, self._camera, self._noise, self._config = field, camera, noise, config
        self._pictures = [resize_picture(sighting.picture, camera) for sighting in sightings]
        self._patches = [count_patches(picture, noise_std=noise.usual_std(field)) for picture in self._pictures]
        self._poses = {start: [sighting.pose for sighting in sightings]}
        self._costs: dict[int, np.ndarray] = {}
        self._pixels = draw_spaced_pixels(camera, config.pixels, torch.Generator().manual_seed(0))

    def costs(self, index: int) -> np.ndarray:
        """Return J_j at x = `index` steps, descended from the poses of the nearest x so far."""
        if index not in self._costs:
            near = min(self._poses, key=lambda known: abs(known - index))
            ends = [self._fit(number, index, pose) for number, pose in enumerate(self._poses[near])]
            self._poses[index] = [pose for pose, _ in ends]
            self._costs[index] = np.array([cost for _, cost in ends])
        return self._costs[index]

    def _fit(self, number: int, index: int, start: Pose) -> tuple[Pose, float]:
        config, picture, draws = self._config, self._pictures[number], torch.Generator().manual_seed(0)
        camera = self._camera.magnified(math.exp(index * config.step))
        view, beside = View((self._field,), camera, _ITSELF), 0.5 * config.step * camera.width

        def prior(pixels: int) -> Prior:
            return exposure_prior(self._noise, pixels, self._patches[number])

        guess = align_picture(picture, view, Guess.at(start[None]), beside, prior, AlignConfig(), draws)
        seen = Observation.of(picture, self._pixels, view.at(0))
        newton = NewtonConfig(config.iterations, robust=AlignConfig.robust)
        *_, here = improve(seen, guess, prior(len(self._pixels)), newton, every=False)
        return here.guess.pose[0], float(here.cost[0])


def _vertex(costs: np.ndarray, step: float) -> tuple[float, float]:
    """Return the x of the least sum of costs (3, pictures), at -step, 0 and step, and its standard deviation."""
    total, count = costs.sum(1), costs.shape[1]
    bend = float(total[0] - 2 * total[1] + total[2]) / step**2
    if not bend > 0:
        return 0.0, math.inf
    if count == 1:
        return _least(total, step), math.sqrt(2 / bend)
    without = np.array([_least(total - costs[:, index], step) for index in range(count)])
    jackknife = math.sqrt((count - 1) / count * float(((without - without.mean()) ** 2).sum()))
    return _least(total, step), max(jackknife, math.sqrt(2 / bend))


def _least(costs: np.ndarray, step: float) -> float:
    """Return where the parabola through three costs is least, within their range."""
    left, here, right = costs
    return step * float(np.clip(0.5 * (left - right) / max(left - 2 * here + right, 1e-12), -1, 1))

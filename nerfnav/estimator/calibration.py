"""Calibration: compare the errors of a filter in a field with the covariances that it claims there.

The filter is a black box: pictures from known poses are given to its `correct` with a prediction that is off by a draw
of the process noise of one step. With Lambda the prior's covariance and P_i the posterior's, a picture claims the
information H_i = P_i^-1 - Lambda^-1. Errors e_i of the pose, position [m] in the world's axes and attitude [rad], are

    e_i ~ N(0, (Lambda^-1 + H_i / rho)^-1 + F),   F = diag(f_p^2, f_p^2, f_p^2, f_a^2, f_a^2, f_a^2)

with rho how many times less a picture tells, and f_p, f_a errors that no picture reduces; all three are the likeliest.
Errors have longer tails than a Gaussian, so all three are widened until 97.5 % of the errors of the position lie
inside of its 95 % ellipsoid.
A correction that was rejected, or ended where the prediction excludes the truth, is a failure: it is counted, and
neither dropped nor taken for a large error of the others.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy
import torch
from jaxtyping import Float

from nerfnav.core.deadline import Deadline
from nerfnav.core.steps import run_steps
from nerfnav.estimator.core.belief import ELLIPSOID_95, POSE, Belief
from nerfnav.estimator.core.filter_config import FastConfig
from nerfnav.estimator.core.filter_step import Corrector, FilterOutcome
from nerfnav.estimator.gauss_newton.fast_filter import FastFilter
from nerfnav.estimator.photometric.pyramid import reduce_camera, resize_picture
from nerfnav.estimator.photometric.residuals import ColorNoise
from nerfnav.field import Field, FieldInfo
from nerfnav.geometry import FORWARD_MOUNT, Pose, PosedImages, so3
from nerfnav.robots import RigidState, StateNoise, load

_VIEWS, _DRAWS = 60, 1
"""Pictures at most, and predictions of each."""
_FEWEST = 12
"""Fewest corrections that give a calibration."""
_PLACE = 0.005
"""Standard deviation of a prediction's position in a large place [longest edges of the box]: there, robots are larger
and see less; at least the paper's 2 cm."""
_EXCLUDED = 22.5
"""Chi-squared of six numbers that is exceeded once in 1,000."""
_TAIL = 0.975
"""Share of the corrections that lie inside: more than 95 %, for a few pictures hold few of the worst."""
_SMALLEST = 1e-4
"""Floor that stands for none [m, rad]."""


@dataclass(frozen=True)
class Calibration:
    """Calibration of a filter in a field: floors of its errors, and information of the pictures."""

    position_floor_m: float
    """f_p: standard deviation of a coordinate that no picture reduces [m]."""
    attitude_floor_rad: float
    """f_a: the same of the attitude [rad]."""
    information_ratio: float
    """rho: factor by which a picture tells less than the filter claims, at least 1."""
    failed_share: float
    """Share of the corrections that failed."""
    corrections: int
    """Number of corrections that were tried."""

    def note_in(self, info: FieldInfo) -> FieldInfo:
        """Return the info of a field with its calibration."""
        return replace(
            info,
            position_floor_m=self.position_floor_m,
            attitude_floor_rad=self.attitude_floor_rad,
            information_ratio=self.information_ratio,
            failed_share=self.failed_share,
        )


def calibrate_field(
    field: Field, info: FieldInfo, pictures: PosedImages, seed: int = 0, until: Deadline | None = None
) -> Calibration | None:
    """Calibrate the fast filter in a field by pictures from known poses; None where too few show anything.

    With `until`, the pictures come in random order, and after the fewest that are needed those end it that are left.
    """
    camera = reduce_camera(pictures.camera)
    every = max(1, -(-len(pictures) // _VIEWS))
    chosen = pictures.subset(slice(0, len(pictures), every))
    images = torch.stack([resize_picture(image, camera) for image in chosen.images])
    config = FastConfig(color_noise=ColorNoise().measured(info.noise_std), floor=StateNoise(0, 0, 0, 0), grain=0.0)
    estimator = FastFilter(field, load("quadrotor"), camera, FORWARD_MOUNT, config)
    noise = replace(StateNoise(), position_m=max(StateNoise.position_m, _PLACE * float(field.box.size.max())))
    resized = PosedImages(images, camera, chosen.poses)
    return calibrate_filter(estimator, resized, noise, torch.Generator().manual_seed(seed), until)


def calibrate_filter(
    estimator: Corrector,
    pictures: PosedImages,
    noise: StateNoise,
    generator: torch.Generator,
    until: Deadline | None = None,
) -> Calibration | None:
    """Calibrate a filter with a camera at FORWARD_MOUNT by pictures from known poses; None where too few tell anything.

    Predictions are off by draws of `noise`. `until` is that of `calibrate_field`.
    """
    if until is not None:
        pictures = pictures.subset(torch.randperm(len(pictures), generator=generator).tolist())
    prior = noise.covariance()[POSE][:, POSE].double().numpy()
    tried, ends = 0, []
    for result in _correct_all(estimator, pictures, noise, generator):
        tried += 1
        if result is not None:
            ends.append(result)
        if until is not None and tried >= _FEWEST and until.left_s <= 0:
            break
    if tried < _FEWEST:
        return None
    if len(ends) < _FEWEST:
        return Calibration(noise.position_m, noise.attitude_rad, 1.0, 1 - len(ends) / tried, tried)
    errors, covariances = (np.stack(part) for part in zip(*ends, strict=True))
    position, attitude, ratio = fit_calibration(errors, covariances, prior).tolist()
    return Calibration(position, attitude, ratio, 1 - len(ends) / tried, tried)


def fit_calibration(
    errors: Float[np.ndarray, "n 6"], claimed: Float[np.ndarray, "n 6 6"], prior: Float[np.ndarray, "6 6"]
) -> Float[np.ndarray, "3"]:
    """Return f_p, f_a and rho for errors with the `claimed` posteriors P_i of one prior Lambda."""
    known = np.linalg.inv(prior)
    seen = np.linalg.inv(claimed) - known

    def expected(logs: Float[np.ndarray, "3"]) -> Float[np.ndarray, "n 6 6"]:
        position, attitude, ratio = np.exp(logs)
        return np.linalg.inv(known + seen / ratio) + np.diag(np.repeat([position**2, attitude**2], 3))

    def unlikelihood(logs: Float[np.ndarray, "3"]) -> float:
        covariances = expected(logs)
        return float(_squares(errors, covariances).sum() + np.linalg.slogdet(covariances)[1].sum())

    bounds = [(math.log(_SMALLEST), 0.0), (math.log(_SMALLEST), 0.0), (0.0, math.log(1e3))]
    starts = [np.array([floor, floor, ratio]) for floor in (-8.0, -5.0) for ratio in (0.1, 2.0)]
    ends = [scipy.optimize.minimize(unlikelihood, start, method="Nelder-Mead", bounds=bounds) for start in starts]
    best = min(ends, key=lambda end: end.fun).x
    tail = np.quantile(_squares(errors[:, :3], expected(best)[:, :3, :3]), _TAIL) / ELLIPSOID_95
    widen = max(1.0, float(tail))
    return np.exp(best) * np.array([math.sqrt(widen), math.sqrt(widen), widen])


def _squares(errors: Float[np.ndarray, "n k"], covariances: Float[np.ndarray, "n k k"]) -> Float[np.ndarray, " n"]:
    """Return e' Sigma^-1 e of each error."""
    return np.einsum("ni,ni->n", errors, np.linalg.solve(covariances, errors[..., None])[..., 0])


def _correct_all(
    estimator: Corrector, pictures: PosedImages, noise: StateNoise, generator: torch.Generator
) -> Iterator[tuple[Float[np.ndarray, "6"], Float[np.ndarray, "6 6"]] | None]:
    """Yield error and claimed covariance of each correction, None for a failed one; leave pictures of nothing out."""
    inverse = torch.linalg.inv(noise.covariance()[POSE][:, POSE])
    for index in range(len(pictures)):
        true = _state_of(pictures.poses[index])
        for _ in range(_DRAWS):
            prediction = Belief(true.retract(noise.sample(generator)), noise.covariance())
            result = run_steps(estimator.correct(prediction, pictures.images[index], generator))
            if result.outcome is FilterOutcome.PREDICTED_ONLY:
                continue
            error = result.posterior.mean.local(true)[POSE]
            excluded = error @ inverse @ error > _EXCLUDED
            if result.outcome is FilterOutcome.DIVERGED or excluded:
                yield None
            else:
                yield error.double().numpy(), result.posterior.covariance[POSE][:, POSE].double().numpy()


def _state_of(camera: Pose) -> RigidState:
    """Return a robot at rest whose camera is there."""
    zero = torch.zeros(3)
    return RigidState(camera.position, zero, so3.project(camera.rotation @ FORWARD_MOUNT.rotation.T), zero)

"""Expected noise of flights by camera in a place: how well a robot knows its state there, as plans have to allow for.

Where pictures tell little, the error of the estimate is larger than `NoiseModel.estimate`, which was measured in places
of rich texture, and a plan that keeps clear of walls by that much touches them. At a few free places, with the better
of two opposite headings (robots choose theirs for what they see), the covariance of the filter at rest settles where

    Sigma = ((A Sigma A' + Q)^-1 + H)^-1 + F

with H and F as in expected_belief.py. The median over the places is the error of the estimate of all plans there, so
that one collision map serves all of them.
"""

import math
from functools import lru_cache

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.estimator import FilterConfig
from nerfnav.estimator.core.belief import POSE
from nerfnav.estimator.gauss_newton.expected_information import expected_information
from nerfnav.estimator.photometric.pyramid import View
from nerfnav.field import Field
from nerfnav.geometry import Pose, so3
from nerfnav.navigation.expected_belief import add_picture, can_expect
from nerfnav.navigation.flight import NavigateConfig
from nerfnav.navigation.gyroscopes import measured_noise
from nerfnav.planner import OccupancyMap
from nerfnav.planner.risk.tracking_error import relative_degrees, tracking_deviations
from nerfnav.robots import NoiseModel, ProcessNoise, Robot, StateNoise

_PLACES, _HEADINGS = 6, 2
"""Free places, and even headings at each, from which pictures are expected: 15 to 40 ms each."""
_ROUNDS, _STEPS = 2, 12
"""Pictures expected from each pose, the second one over the covariance that the first leaves; time steps after which
the covariance has settled."""
_USUAL = NoiseModel().estimate
"""Error of the estimate in places of rich texture. A picture that leaves no more of it needs no second look."""
_MORE = 1.1
"""Growth of the tracking error from which on the error of the estimate is that of the place."""


def expect_noise(
    field: Field, occupancy: OccupancyMap, robot: Robot, config: NavigateConfig, dt: float = 0.1
) -> NoiseModel:
    """Expect the noise of flights by camera in a field, where `occupancy` says that the robot fits.

    The error of the estimate is the default one where the tracking error (planner/risk/tracking_error.py) is about the
    same by it, in open loop, and where no field predicts quickly what the camera sees. The filter of the configuration
    has the noise and the floor of the field (`FastConfig.for_field`); `dt` is the length of a time step [s].
    """
    usual = NoiseModel(config.noise)
    if config.open_loop or not can_expect(field):
        return usual
    process = measured_noise(config.noise, dt) if config.imu else config.noise
    view = View((field,), robot.camera, robot.mount)
    deviations = _expect_deviations(view, occupancy, robot, config.filter, process, dt)
    if deviations is None:
        return usual
    estimate = StateNoise(*(max(pair) for pair in zip(deviations, _USUAL.deviations, strict=True)))
    expected = NoiseModel(config.noise, estimate)
    error, usual_error = (tracking_deviations(robot, dt, noise)[-1].level for noise in (expected, usual))
    return expected if error > _MORE * usual_error else usual


@lru_cache(maxsize=2)
def _expect_deviations(
    view: View, occupancy: OccupancyMap, robot: Robot, config: FilterConfig, process: ProcessNoise, dt: float
) -> tuple[float, float, float, float] | None:
    """Expect standard deviations of position [m], velocity [m/s], attitude [rad] and body rate [rad/s]; None without
    free places. To two digits, for arithmetic differs between machines."""
    floor, draws = config.floor_at(view.grain).covariance(), torch.Generator().manual_seed(0)
    by_state, _ = relative_degrees(robot, dt)
    found = []
    for place in _free_places(occupancy, draws):
        yaw = float(torch.rand((), generator=draws))
        best = torch.full((4,), math.inf)
        for turn in range(_HEADINGS):
            if best[0] > _USUAL.position_m:
                heading = math.tau * (yaw + turn / _HEADINGS)
                settled = _settle(view, place, heading, config, by_state.float(), process, floor, draws)
                best = min(best, _deviations(settled), key=lambda each: float(each[0]))
        found.append(best)
    if not found:
        return None
    deviations = torch.stack(found)
    position, velocity, attitude, rate = (float(f"{value:.2g}") for value in deviations.median(0).values.tolist())
    return position, velocity, attitude, rate


def _deviations(covariance: Float[Tensor, "12 12"]) -> Float[Tensor, "4"]:
    """Return standard deviations of position, velocity, attitude and body rate, each over its three axes."""
    return covariance.diagonal().reshape(4, 3).mean(-1).sqrt()


def _free_places(occupancy: OccupancyMap, draws: torch.Generator) -> Float[Tensor, "n 3"]:
    """Draw places where the body fits [m]."""
    free = (~occupancy.occupied).flatten().nonzero()[:, 0]
    drawn = free[torch.randperm(len(free), generator=draws)[:_PLACES]]
    # NumPy's, for torch's imports a computer algebra system: 0.5 s
    index = np.stack(np.unravel_index(drawn.numpy(), occupancy.occupied.shape), -1)
    return occupancy.centers(torch.from_numpy(index))


def _settle(
    view: View,
    place: Float[Tensor, "3"],
    yaw: float,
    config: FilterConfig,
    by_state: Float[Tensor, "12 12"],
    process: ProcessNoise,
    floor: Float[Tensor, "12 12"],
    draws: torch.Generator,
) -> Float[Tensor, "12 12"]:
    """Return the covariance of the filter at rest after pictures from a pose, in axes that turn with the body."""
    rotation = so3.from_yaw(torch.tensor(yaw))
    turned = torch.block_diag(rotation, torch.eye(3))  # A is that of a body at yaw 0
    covariance, noise = _USUAL.covariance(), process.covariance()
    for index in range(_ROUNDS):
        if index > 0 and _deviations(covariance)[0] <= _USUAL.position_m:
            break
        predicted = by_state @ covariance @ by_state.T + noise
        pose = turned @ predicted[POSE][:, POSE] @ turned.T
        information = expected_information(view, Pose(rotation, place), pose, config, draws)
        information = turned.T @ information @ turned
        for _ in range(_STEPS):
            predicted = by_state @ covariance @ by_state.T + noise
            covariance = add_picture(predicted, information, floor)
    return covariance

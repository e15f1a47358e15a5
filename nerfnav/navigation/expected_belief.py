"""Expected belief: how well a robot will know its position along a plan, before it flies.

    Sigma-_t = A Sigma_{t-1} A' + Q,   Sigma_t = (Sigma-_t^-1 + H_t)^-1 + F

along the states of the plan, with Q the process noise of the flight, H_t the information of the picture that the field
shows from there (estimator/gauss_newton/expected_information.py), and F the floor of the filter. A flight by the fast
filter that keeps to its plan has about these covariances; one that holds and looks around has others.

A robot that is expected to be BLIND anywhere, less sure than `SupervisorConfig.widest`, of which three standard
deviations are the least clearance in which the supervisor lets a robot fly on, may be lost there: users are warned.
"""

import math
from collections.abc import Generator, Sequence
from functools import lru_cache

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.steps import run_steps
from nerfnav.estimator import Belief, ConsiderCovariance, FilterConfig
from nerfnav.estimator.consistency import REMEDY
from nerfnav.estimator.core.belief import POSE, add_information, posterior_covariance
from nerfnav.estimator.core.prediction import predict
from nerfnav.estimator.gauss_newton.expected_information import expected_information
from nerfnav.estimator.paper.cost import precision
from nerfnav.estimator.photometric.pyramid import View
from nerfnav.field import Field, get_ray_grid
from nerfnav.geometry import Pose, so3
from nerfnav.navigation.episode import ExpectedSigma
from nerfnav.navigation.flight import FlightContext, NavigateConfig
from nerfnav.navigation.gyroscopes import measured_noise
from nerfnav.robots import POSITION, Motion, RigidState, Robot, StateNoise

_PICTURES = 16
"""Pictures that are expected along a plan, at most: between two of them H stays."""
_HEADINGS = 8
"""Headings from which pictures are expected at a place: 10 to 20 ms each."""
_NEARBY = 0.4
"""Distance from a place within which a picture shows about what one from there does [m]."""


def explain_blindness(share: float, most: float | None = None, in_draft: bool = False) -> str:
    """Explain that on a share of the plan, 0 to 1, there is too little to see, and name the remedies; `most` is the
    largest share that is accepted, where it is exceeded. A draft of a field shows less than it will."""
    excess = "" if most is None else f", more than the {100 * most:.0f} % that are accepted"
    remedy = "this field is a draft, fly once it is trained" if in_draft else REMEDY
    return f"too little to see on {max(1, round(100 * share))} % of the way{excess}: {remedy}"


def can_expect(field: Field) -> bool:
    """Check whether what a field shows is known quickly: on grids that kernels know, not by the reference renderer."""
    return get_ray_grid(field) is not None


def expect_sigma(
    motion: Motion, robot: Robot, field: Field, config: NavigateConfig, map_error: ConsiderCovariance
) -> ExpectedSigma | None:
    """Expect the standard deviation of the position along a plan by a robot whose camera sees the field.

    None in open loop, for plans that are not finite, and for fields of which `can_expect` is False. The filter of the
    configuration has the noise and the floor of the field (`FastConfig.for_field`).
    """
    return run_steps(expect_sigma_in_steps(motion, robot, field, config, map_error))


def expect_sigma_in_steps(
    motion: Motion, robot: Robot, field: Field, config: NavigateConfig, map_error: ConsiderCovariance
) -> Generator[None, None, ExpectedSigma | None]:
    """Return what `expect_sigma` returns; yield after each picture that is expected, in some 30 ms."""
    finite = motion.states.position.isfinite().all() and motion.actions.isfinite().all()
    if config.open_loop or not finite or not can_expect(field):
        return None
    beliefs = yield from expect_beliefs(motion, robot, View((field,), robot.camera, robot.mount), config)
    reported = torch.tensor([map_error.beside(belief).position_std for belief in beliefs])
    filtered = torch.tensor([belief.position_std for belief in beliefs])
    median, p95, largest = reported.quantile(torch.tensor([0.5, 0.95, 1.0])).tolist()
    return ExpectedSigma(median, p95, largest, (filtered > config.recovery.widest).float().mean().item())


def expect_sigma_in_flight(motion: Motion, flight: FlightContext) -> ExpectedSigma | None:
    """Expect it for the plan of a flight; None also where no field predicts what its camera sees, and in a world whose
    time steps have no noise of their own."""
    field, simulator = flight.stack.camera_field, flight.simulator
    if field is None or simulator.noise is None:
        return None
    return expect_sigma(motion, simulator.robot, field, flight.config, flight.stack.map_error)


def expect_beliefs(
    motion: Motion, robot: Robot, view: View, config: NavigateConfig
) -> Generator[None, None, list[Belief]]:
    """Return the expected belief of the filter, without the map error, at each of the n + 1 times of a plan of n steps;
    yield after each picture that is expected."""
    draws, floor = torch.Generator().manual_seed(0), config.filter.floor_at(view.grain).covariance()
    every = max(1, -(-len(motion.actions) // _PICTURES))
    noise = measured_noise(config.noise, motion.dt) if config.imu else config.noise
    belief = Belief(motion.states[0], config.initial.covariance())
    information, beliefs = torch.zeros(len(POSE), len(POSE)), list[Belief]()
    for index in range(len(motion.actions) + 1):
        if index > 0:
            belief = predict(belief, motion.actions[index - 1], robot, motion.dt, noise)
        if index > 0 or config.look_first:
            predicted = belief.covariance
            if index % every == 0:
                pose = predicted[POSE][:, POSE]
                information = expected_information(view, belief.mean.pose, pose, config.filter, draws)
                yield
            belief = Belief(belief.mean, add_picture(predicted, information, floor))
        beliefs.append(belief)
    return beliefs


def add_picture(
    predicted: Float[Tensor, "12 12"], information: Float[Tensor, "6 6"], floor: Float[Tensor, "12 12"]
) -> Float[Tensor, "12 12"]:
    """Return the covariance of the filter after a picture: (Sigma-^-1 + H)^-1 + F."""
    hessian = 2 * add_information(torch.zeros(3), precision(predicted), information)
    return posterior_covariance(hessian, predicted)[0] + floor


def expect_remainder(
    place: RigidState, views: Sequence[Belief], flight: FlightContext
) -> Float[np.ndarray, " h"] | None:
    """Expect the variance of the position that one picture leaves, by the heading of a level robot at a place.

    The headings are even from 0 to a whole turn; the variance is that of the weakest direction, at most 1, in units of
    that of a robot that is BLIND, `SupervisorConfig.widest`, which is taken to be the one before. `views` are beliefs
    after pictures, the oldest first: no heading leaves less than the last picture from nearby did, for what a field
    promises may be wrong. None where no field predicts quickly what the camera sees.
    """
    field, simulator, config = flight.stack.camera_field, flight.simulator, flight.config
    if field is None or not can_expect(field):
        return None
    view, std = View((field,), simulator.robot.camera, simulator.mount), config.recovery.widest
    left = np.zeros(_HEADINGS)
    for belief in views:
        if (belief.mean.position - place.position).norm() < _NEARBY:
            heading = so3.yaw_of(belief.mean.rotation).item() * _HEADINGS / math.tau
            left[round(heading) % _HEADINGS] = _share_left(belief.covariance, std)
    return np.maximum(left, _remainder(view, tuple(place.position.tolist()), config.filter, std))


@lru_cache(maxsize=8)
def _remainder(view: View, place: tuple[float, float, float], config: FilterConfig, std: float) -> np.ndarray:
    """Expect it from the field alone: a robot holds, and has its goal, at the same place for many time steps."""
    draws, before = torch.Generator().manual_seed(0), StateNoise.isotropic(std**2).covariance()[POSE][:, POSE]
    left = []
    for yaw in torch.arange(_HEADINGS) * (math.tau / _HEADINGS):
        pose = Pose(so3.from_yaw(yaw), torch.tensor(place))
        information = expected_information(view, pose, before, config, draws)
        left.append(_share_left(torch.linalg.inv(precision(before) + information), std))
    return np.array(left)


def _share_left(covariance: Float[Tensor, "n n"], std: float) -> float:
    """Return the largest variance of the position in any direction, at most 1, in units of `std` squared [m^2]."""
    return min(1.0, torch.linalg.eigvalsh(covariance[POSITION, POSITION]).max().item() / std**2)

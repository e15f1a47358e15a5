"""Prediction by a simulated inertial measurement unit, with known biases and noise."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.estimator import Belief
from nerfnav.geometry import so3
from nerfnav.inertial import ImuConfig
from nerfnav.inertial.inertial_motion import InertialBelief
from nerfnav.inertial.inertial_motion import predict as predict_with_noise
from nerfnav.inertial.preintegrated import Preintegrated
from nerfnav.robots import ATTITUDE, POSITION, RigidState
from nerfnav.tracking.frame import ImuMeasurements
from nerfnav.tracking.preintegration import preintegrate

CONFIG = ImuConfig()
BIASES = torch.tensor([0.02, -0.03, 0.01, 0.2, -0.1, 0.15], dtype=torch.float64)
G = torch.tensor([0.0, 0.0, -CONFIG.gravity], dtype=torch.float64)


def truth(time: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Position, and attitude as a rotation vector, of a motion that shakes about all axes; and its acceleration."""
    phases = torch.tensor([[1.3, 0.2], [1.7, 1.1], [0.9, 2.0]], dtype=torch.float64)
    angle = time[:, None] * phases[:, 0] + phases[:, 1]
    turn = 0.5 * torch.sin(1.1 * angle + 0.3)
    return 0.6 * torch.sin(angle), turn, -0.6 * phases[:, 0] ** 2 * torch.sin(angle)


def state_at(time: float) -> RigidState:
    step = 1e-5
    position, turn, _ = truth(torch.tensor([time - step, time, time + step], dtype=torch.float64))
    rotation = so3.exp(turn)
    rate = so3.local(rotation[0], rotation[2]) / (2 * step)
    return RigidState(position[1], (position[2] - position[0]) / (2 * step), rotation[1], rate)


def measurements(
    end: float, period: float = 0.005, biases: torch.Tensor | None = None, seed: int | None = None
) -> ImuMeasurements:
    """What a unit measures every period."""
    times = torch.arange(round(end / period), dtype=torch.float64) * period
    _, _, acceleration = truth(times)
    step = 1e-5
    before, here, after = (so3.exp(truth(times + offset)[1]) for offset in (-step, 0.0, step))
    rates = so3.local(before, after) / (2 * step)
    forces = ((acceleration - G)[:, None] @ here)[:, 0]
    if biases is not None:
        rates, forces = rates + biases[:3], forces + biases[3:]
    if seed is not None:
        draws = torch.Generator().manual_seed(seed)
        rates = rates + CONFIG.gyro / period**0.5 * torch.randn(rates.shape, generator=draws).double()
        forces = forces + CONFIG.accel / period**0.5 * torch.randn(forces.shape, generator=draws).double()
    return ImuMeasurements(times, rates, forces)


def predict(last: InertialBelief, measured: Preintegrated, config: ImuConfig) -> InertialBelief:
    return predict_with_noise(last, measured, config)[0]


def begun(time: float, std: float = 0.01) -> InertialBelief:
    return InertialBelief.begin(Belief(state_at(time), std**2 * torch.eye(12).double()), CONFIG)


def test_a_perfect_unit_predicts_the_motion() -> None:
    measured = preintegrate(measurements(2.0), 0.5, 1.5, torch.zeros(6).double(), CONFIG)
    after = predict(begun(0.5), measured, CONFIG).belief.mean
    off = state_at(1.5).local(after)
    assert off[POSITION].norm() < 2e-4 and off[ATTITUDE].norm() < 1e-4 and off[3:6].norm() < 5e-4


def test_known_biases_are_taken_away() -> None:
    measured = preintegrate(measurements(2.0, biases=BIASES), 0.5, 1.5, BIASES, CONFIG)
    assert state_at(1.5).local(predict(begun(0.5), measured, CONFIG).belief.mean)[:9].norm() < 1e-3


@pytest.mark.slow
def test_derivatives_by_the_biases_are_those_of_finite_differences() -> None:
    inertial, step = measurements(1.0, biases=BIASES), 1e-5
    here = preintegrate(inertial, 0.1, 0.6, BIASES, CONFIG)
    for index in range(6):
        low, high = (preintegrate(inertial, 0.1, 0.6, BIASES + sign * step * torch.eye(6).double()[index], CONFIG)
                     for sign in (-1, 1))  # fmt: skip
        (low, high) = low.increments, high.increments
        slope = torch.cat([so3.local(low.turn, high.turn), high.speed - low.speed, high.way - low.way]) / (2 * step)
        np.testing.assert_allclose(here.by_biases[:, index], slope, atol=1e-4)


def test_the_derivative_by_the_state_is_that_of_finite_differences() -> None:
    measured = preintegrate(measurements(1.0), 0.1, 0.5, torch.zeros(6).double(), CONFIG)
    start, silent = begun(0.1), replace(measured, covariance=torch.zeros(9, 9).double(), rate_variance=0.0)
    start = replace(start, covariance=torch.zeros(9, 9).double())
    spread = predict(start, silent, replace(CONFIG, gyro_walk=0, accel_walk=0)).belief.covariance / 0.01**2
    slopes, step = torch.zeros(12, 12).double(), 1e-6
    for index in range(12):
        pair = []
        for sign in (-1, 1):
            moved = start.belief.mean.retract(sign * step * torch.eye(12).double()[index])
            pair.append(predict(replace(start, belief=replace(start.belief, mean=moved)), silent, CONFIG).belief.mean)
        slopes[:, index] = pair[0].local(pair[1]) / (2 * step)
    np.testing.assert_allclose(spread, slopes @ slopes.T, atol=1e-5)


@pytest.mark.parametrize("seed", range(2))
def test_biases_are_found_from_poses_and_the_belief_is_honest(seed: int) -> None:
    """Poses of 3 mm and 3 mrad stand for pictures, ten a second; the update is that of a Kalman filter."""
    inertial, draws = measurements(12.0, 0.01, BIASES, seed), torch.Generator().manual_seed(100 + seed)
    believed, sight = begun(0.0), 0.003
    pose = [0, 1, 2, 6, 7, 8]
    errors = []
    for index in range(1, 119):
        time = 0.1 * index
        measured = preintegrate(inertial, time - 0.1, time, believed.biases, CONFIG)
        ahead = predict(believed, measured, CONFIG)
        noise = sight * torch.randn(6, generator=draws).double()
        seen = state_at(time).retract(torch.zeros(12).double().index_put((torch.tensor(pose),), noise))
        prior = ahead.belief.covariance
        gain = torch.linalg.solve(prior[pose][:, pose] + sight**2 * torch.eye(6).double(), prior[pose]).T
        change = gain @ ahead.belief.mean.local(seen)[pose]
        posterior = Belief(ahead.belief.mean.retract(change), prior - gain @ prior[pose])
        believed = ahead.corrected(posterior)
        errors.append(state_at(time).local(believed.belief.mean)[:9])
    off = (believed.biases - BIASES).abs()
    std = believed.covariance.diagonal()[:6].sqrt()
    assert (off < 4 * std).all() and off[:3].max() < 0.002 and off[3:].max() < 0.05
    last = torch.stack(errors[40:])
    assert last[:, :3].norm(dim=1).mean() < 0.004 and last[:, 3:6].norm(dim=1).mean() < 0.03
    nees = [float(error @ torch.linalg.solve(believed.belief.covariance[:9, :9], error)) for error in last]
    assert 4 < np.mean(nees) < 16, "9 is honest"


def test_measurements_that_are_missing_are_told() -> None:
    inertial = measurements(2.0)
    late = ImuMeasurements(inertial.times[100:], inertial.body_rates[100:], inertial.specific_forces[100:])
    kept = (inertial.times < 0.8) | (inertial.times > 1.2)
    holed = ImuMeasurements(inertial.times[kept], inertial.body_rates[kept], inertial.specific_forces[kept])
    zero = torch.zeros(6).double()
    for source, start, end in ((late, 0.1, 0.9), (holed, 0.5, 1.5), (inertial, 1.5, 2.5), (inertial, 5.0, 5.1)):
        with pytest.raises(InvalidInputError, match=r"the inertial measurements have a gap of more than 0\.1 s"):
            preintegrate(source, start, end, zero, CONFIG)
    with pytest.raises(InvalidInputError, match="not from 1 s to 1 s"):
        preintegrate(inertial, 1.0, 1.0, zero, CONFIG)

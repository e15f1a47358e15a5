"""Polynomials for the Crazyflie, read back as crazyswarm2's loader reads them: with numpy.loadtxt."""

import io
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import torch

from nerfnav import robots
from nerfnav.core.errors import InvalidInputError
from nerfnav.export.crazyflie import MOST_PIECES, crazyflie
from nerfnav.export.curves import SmoothConfig, curve_of
from nerfnav.export.flatness import QuadrotorLimits
from nerfnav.export.recording import Recording
from nerfnav.export.tables import Table
from nerfnav.robots.quadrotor import Quadrotor
from nerfnav.robots.quadrotor_config import QuadrotorConfig
from tests.export.flights import flight, hover_to_hover, plan
from tests.export.readers import pieces_of_csv


def loaded(content: bytes) -> np.ndarray:
    """A file as crazyswarm2 loads it; each row must be a piece."""
    data = np.loadtxt(io.BytesIO(content), delimiter=",", skiprows=1, usecols=range(33))
    assert data.ndim == 2, "a file of one row becomes a vector there, and crashes the loader"
    return data


def evaluated(data: np.ndarray, time: float, order: int = 0) -> np.ndarray:
    """x, y, z, yaw or a derivative, piece after piece as that loader goes through them."""
    begun = 0.0
    for row in data:
        if time <= begun + row[0]:
            return np.array([np.polynomial.Polynomial(row[1 + 8 * k : 9 + 8 * k]).deriv(order)(time - begun)
                             if order else np.polynomial.Polynomial(row[1 + 8 * k : 9 + 8 * k])(time - begun)
                             for k in range(4)])  # fmt: skip
        begun += row[0]
    raise AssertionError(f"{time} s is after the end")


def disturbed(recording: Recording, spread: float) -> Recording:
    """The same with positions that jump [m]."""
    values = recording.table.values.clone()
    jumps = spread * torch.randn(len(values), 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    values[:, 1:4] += jumps
    return replace(recording, table=Table(recording.table.columns, values, recording.table.info))


def test_the_file_follows_the_curve_in_position_velocity_and_acceleration() -> None:
    recording = hover_to_hover()
    made = crazyflie(recording)
    data, curve = loaded(made.content), curve_of(recording)
    stretch = made.info["stretched_by"]
    for time in np.linspace(0, curve.duration, 41):
        for order, near in ((0, 0.01), (1, 0.12), (2, 1.2)):
            off = evaluated(data, time * stretch, order) * stretch**order - curve.at(np.array([time]), order)[0]
            assert np.linalg.norm(off[:3]) < near, (time, order)
    assert made.info["max_fit_error_m"] < 0.01


@pytest.mark.parametrize("recording", [hover_to_hover(), hover_to_hover(60), flight(), flight(30)])
def test_what_is_asked_of_the_robot_is_within_its_limits_and_reported(recording: Recording) -> None:
    made, config = crazyflie(recording), Quadrotor().config
    data = loaded(made.content)
    times = np.linspace(0, data[:, 0].sum(), 400)
    acceleration = np.array([evaluated(data, time, 2)[:3] for time in times])
    acceleration[:, 2] += config.gravity
    thrust = config.mass * np.linalg.norm(acceleration, axis=-1)
    tilt = np.arccos(acceleration[:, 2] / np.linalg.norm(acceleration, axis=-1))
    assert thrust.max() <= 1.01 * made.info["max_thrust_n"] <= 1.02 * config.max_thrust
    assert tilt.max() <= 1.01 * np.radians(made.info["max_tilt_deg"]) <= 1.02 * config.max_tilt
    assert made.info["max_body_rate_radps"] <= 1.01 * config.max_rate
    assert made.info["max_speed_mps"] <= 1.01 * config.max_speed


def test_a_flight_that_jumps_is_smoothed_and_ends_at_rest() -> None:
    made = crazyflie(flight())
    data = loaded(made.content)
    assert made.info["motion"] == "the flown path, smoothed" and 0 <= made.info["off_rows_m"] < 0.05
    assert made.info["end_speed_mps"] < 1e-6
    np.testing.assert_allclose(evaluated(data, float(np.sum(data[:, 0])), 1), 0, atol=1e-6)


def test_start_and_goal_are_met_exactly() -> None:
    recording = hover_to_hover()
    data = loaded(crazyflie(recording).content)
    np.testing.assert_allclose(evaluated(data, 0.0)[:3], recording.position[0], atol=1e-6)
    np.testing.assert_allclose(evaluated(data, float(np.sum(data[:, 0])))[:3], recording.position[-1], atol=1e-6)


def test_pieces_meet_without_a_jump_up_to_the_jerk() -> None:
    data = loaded(crazyflie(flight()).content)
    for first, second in pairwise(data):
        for order in range(4):
            before, after = (
                np.array([np.polynomial.Polynomial(row[1 + 8 * k : 9 + 8 * k]).deriv(order)(at) for k in range(4)])
                for row, at in ((first, first[0]), (second, 0.0))
            )
            np.testing.assert_allclose(before, after, atol=1e-4 * max(1.0, np.abs(after).max()))


@pytest.mark.parametrize("steps", [5, 7, 13, 100])
def test_durations_add_up_to_the_same_number_in_whatever_order(steps: int) -> None:
    made = crazyflie(hover_to_hover(steps))
    spans = loaded(made.content)[:, 0]
    total = 0.0
    for span in spans:
        total += span
    assert total == np.sum(spans) == spans[::-1].cumsum()[-1] == made.info["duration_s"]
    assert 2 <= len(spans) == made.info["pieces"] <= MOST_PIECES


def test_a_vehicle_with_little_thrust_is_given_more_time() -> None:
    slow = crazyflie(hover_to_hover(), thrust_per_weight=1.02)
    room = QuadrotorLimits.of(Quadrotor()).with_thrust(1.02)
    assert slow.info["stretched_by"] > 1.2 and slow.info["max_thrust_n"] <= 1.01 * room.most["thrust"]
    assert slow.info["max_tilt_deg"] <= 1.01 * np.degrees(np.arccos(1 / 1.02))


def test_what_is_written_is_what_is_read() -> None:
    content = crazyflie(hover_to_hover()).content
    shape, data = pieces_of_csv(content.decode()), loaded(content)
    for time in (0.0, 0.31, 0.9):
        np.testing.assert_allclose(shape(torch.tensor([time]))[0], evaluated(data, time), atol=1e-9)


def test_states_that_no_slowness_helps_are_refused_with_what_is_too_much() -> None:
    weak = Quadrotor(QuadrotorConfig(max_thrust=2.0))
    with pytest.raises(InvalidInputError, match=r"not kept even 6 times as slowly \(thrust 2\.\d+ above 2\)"):
        crazyflie(replace(hover_to_hover(), robot=weak))


def test_states_that_jump_too_far_are_refused_with_the_error() -> None:
    with pytest.raises(InvalidInputError, match=r"only to \d+\.\d cm, and 5 cm is the bound"):
        crazyflie(disturbed(plan(120), 0.3))
    long = flight(100, size=1)
    with pytest.raises(InvalidInputError, match=r"nearer to this flight than \d+\.\d cm"):
        curve_of(disturbed(long, 0.3), SmoothConfig(smoothings=(1.0,)))


@pytest.mark.parametrize("name", ["couch", "diffdrive", "cart", "sofa"])
def test_robots_on_the_ground_are_refused_in_one_sentence(name: str) -> None:
    robot = robots.load(name)
    with pytest.raises(InvalidInputError, match=f"for quadrotors, and {name} does not fly"):
        crazyflie(replace(plan(), robot=robot))


def test_an_unknown_robot_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="need to know their robot"):
        crazyflie(replace(plan(), robot=None))

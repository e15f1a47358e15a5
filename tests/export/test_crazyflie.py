"""Polynomials for the Crazyflie."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from nerfnav.errors import InvalidInputError
from nerfnav.export.crazyflie import MOST_PIECES, FitConfig, Pieces, crazyflie, fit, pieces_of_csv
from nerfnav.export.recording import Recording
from nerfnav.export.tables import Table
from tests.export.flights import plan


def pieces_of(recording: Recording, config: FitConfig | None = None) -> tuple[Pieces, dict]:
    """What a file says, and what the export says of it."""
    made = crazyflie(recording, config)
    durations, coefficients = pieces_of_csv(made.content.decode())
    assert np.ptp(durations) == 0
    return Pieces(float(durations[0]), coefficients), made.info


def disturbed(recording: Recording, spread: float) -> Recording:
    """The same with positions that jump [m]."""
    values = recording.table.values.clone()
    jumps = spread * torch.randn(len(values), 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    values[:, 1:4] += jumps
    return replace(recording, table=Table(recording.table.columns, values, recording.table.info))


def test_the_file_follows_the_states_as_closely_as_it_says() -> None:
    recording = plan()
    pieces, info = pieces_of(recording)
    times = recording.times.numpy()
    values = pieces.value(times)
    off = np.linalg.norm(values[:, :3] - recording.position.numpy(), axis=-1)
    assert off.max() == pytest.approx(info["max_fit_error_m"], abs=1e-6) and off.max() < 0.01
    np.testing.assert_allclose(values[:, 3], recording.yaw(), atol=info["max_fit_error_rad"] + 1e-6)
    assert times[-1] == pytest.approx(pieces.duration * len(pieces.coefficients))


def test_start_and_goal_are_met_exactly_with_their_velocities() -> None:
    recording = plan()
    pieces, _ = pieces_of(recording)
    ends = recording.times.numpy()[[0, -1]]
    np.testing.assert_allclose(pieces.value(ends)[:, :3], recording.position[[0, -1]], atol=1e-6)
    np.testing.assert_allclose(pieces.value(ends, 1)[:, :3], recording.velocity[[0, -1]], atol=1e-5)


@pytest.mark.parametrize("derivative", range(4))
def test_pieces_meet_without_a_jump_up_to_the_jerk(derivative: int) -> None:
    pieces, _ = pieces_of(disturbed(plan(), 0.01))
    end = np.array([pieces.duration])
    for first, second in zip(pieces.coefficients, pieces.coefficients[1:], strict=False):
        left = Pieces(pieces.duration, first[None]).value(end, derivative)
        right = Pieces(pieces.duration, second[None]).value(np.zeros(1), derivative)
        np.testing.assert_allclose(left, right, atol=1e-4 * max(1.0, np.abs(right).max()))


def test_a_polynomial_of_seventh_order_is_met_by_one_piece() -> None:
    coefficients = np.random.default_rng(0).normal(size=(1, 4, 8))
    exact, times = Pieces(1.5, coefficients), np.linspace(0, 1.5, 40)
    found = fit(times, exact.value(times), exact.value(times[[0, -1]], 1), 1, 1e-15)
    np.testing.assert_allclose(found.coefficients, coefficients, atol=1e-4)


def test_long_flights_keep_within_the_vehicles_memory() -> None:
    pieces, info = pieces_of(plan(100))
    assert info["pieces"] == len(pieces.coefficients) == MOST_PIECES


def test_states_that_jump_too_far_are_refused_with_the_error() -> None:
    with pytest.raises(InvalidInputError, match=r"only to \d+\.\d cm, and 5 cm is the bound"):
        crazyflie(disturbed(plan(120), 0.3))

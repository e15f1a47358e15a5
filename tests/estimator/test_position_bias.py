"""Position bias: errors of positions beyond their reported covariances."""

import numpy as np
import pytest

from nerfnav.estimator import fit_position_bias


def reported_covariances(draws: np.random.Generator, count: int) -> np.ndarray:
    """Covariances as pictures tell them: one to three millimetres, a direction three times as far as the others."""
    turns = np.linalg.qr(draws.standard_normal((count, 3, 3)))[0]
    sizes = 1e-3 * draws.uniform(1, 3, (count, 1)) * np.array([0.3, 0.3, 1.0])
    return np.einsum("nij,nj,nkj->nik", turns, sizes**2, turns)


def drawn(draws: np.random.Generator, covariances: np.ndarray) -> np.ndarray:
    return np.einsum("nij,nj->ni", np.linalg.cholesky(covariances), draws.standard_normal((len(covariances), 3)))


@pytest.mark.parametrize("scale", [0.1, 1.0, 10.0])
@pytest.mark.parametrize("bias", [4e-4, 1e-3, 5e-3])
def test_what_was_left_unsaid_is_found_at_any_size(bias: float, scale: float) -> None:
    draws = np.random.default_rng(1)
    reported = reported_covariances(draws, 2000)
    errors = drawn(draws, reported + bias**2 * np.eye(3))
    assert fit_position_bias(scale * errors, scale**2 * reported) == pytest.approx(scale * bias, rel=0.06)


def test_errors_that_were_told_leave_nothing() -> None:
    draws = np.random.default_rng(2)
    reported = reported_covariances(draws, 2000)
    assert fit_position_bias(0.9 * drawn(draws, reported), reported) == 0
    assert fit_position_bias(np.zeros((30, 3)), reported[:30]) == 0

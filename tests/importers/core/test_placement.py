"""Turned upright from whichever direction is up."""

import numpy as np
import pytest

from nerfnav.importers.core.placement import rotation_to_z

_AXES = np.concatenate([np.eye(3), -np.eye(3)])
_ANY = np.random.default_rng(0).normal(size=(200, 3))
_NEARLY_DOWN = [[s, -t, -1.0] for s in (0.0, 1e-3, 1e-7, 1e-11) for t in (1e-2, 1e-6, 1e-9, 1e-11)]
_BEYOND_ROUNDING = [[1e-13, 0.0, -1.0], [0.0, 1e-200, -1.0]]


@pytest.mark.parametrize("ups", [_AXES, _ANY, 1e6 * _ANY, _NEARLY_DOWN, _BEYOND_ROUNDING])
def test_up_of_any_length_is_turned_to_z_by_a_rotation(ups: np.ndarray) -> None:
    for up in np.asarray(ups):
        R = rotation_to_z(up)
        np.testing.assert_allclose(R @ up / np.linalg.norm(up), [0, 0, 1], atol=1e-12)
        np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(R) == pytest.approx(1, abs=1e-12)


@pytest.mark.parametrize("ups", [_AXES, _ANY, _NEARLY_DOWN])
def test_no_rotation_to_z_is_smaller(ups: np.ndarray) -> None:
    for up in np.asarray(ups):
        # a rotation by an angle a has the trace 1 + 2 cos a, and a is at least the angle between the two directions
        assert np.trace(rotation_to_z(up)) == pytest.approx(1 + 2 * up[2] / np.linalg.norm(up), abs=1e-12)


def test_what_is_upright_is_not_turned_at_all() -> None:
    assert rotation_to_z(np.array([0.0, 0.0, 2.0])).tolist() == np.eye(3).tolist()


def test_turning_along_an_axis_leaves_whole_numbers_whole() -> None:
    for up in _AXES:
        assert np.array_equal(rotation_to_z(up), np.rint(rotation_to_z(up)))

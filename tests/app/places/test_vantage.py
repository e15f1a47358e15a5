"""From where a place is looked at first."""

import numpy as np
import pytest

from app.places.vantage import view_of_box, view_of_ends

_BOX = ((-5.0, -5.0, 0.0), (5.0, 5.0, 3.0))


def test_both_ends_are_seen_past_a_wall() -> None:
    start, goal = (-0.5, 0.0, 0.5), (0.5, 0.0, 0.5)

    def wall(points: np.ndarray) -> np.ndarray:
        """South of the ends, higher than any eye."""
        return (points[:, 1] < -0.2) & (points[:, 1] > -0.6)

    (eye, target) = view_of_ends(start, goal, _BOX, wall)
    assert eye[1] > -0.2 and target == pytest.approx((0.0, 0.0, 0.5))


def test_ends_across_all_of_a_place_are_seen_with_all_of_it() -> None:
    view = view_of_ends((-4, -4, 1), (4, 4, 1), _BOX, lambda points: np.zeros(len(points), bool))
    assert view == view_of_box(*_BOX)


def test_where_everything_is_hidden_there_is_a_view_all_the_same() -> None:
    eye, _ = view_of_ends((0, 0, 1), (1, 0, 1), _BOX, lambda points: np.ones(len(points), bool))
    assert np.isfinite(eye).all()

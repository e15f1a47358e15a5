"""From where a place is looked at first."""

import numpy as np
import pytest

from nerfnav_app.places.vantage import View, is_visible, view_of_box, view_of_ends

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


@pytest.mark.parametrize("scale", [0.1, 1.0, 10.0])
@pytest.mark.parametrize(
    ("view", "seen"),
    [
        (view_of_box(*_BOX), True),
        (((0.0, 0.0, 1.0), (1.0, 0.0, 1.0)), True),  # from inside
        (((-9.0, 0.0, 1.0), (0.0, 5.0, 1.0)), True),  # past the middle
        (((-9.0, 0.0, 1.0), (-12.0, 0.0, 1.0)), False),  # away from it
        (((0.0, 0.0, 4.0), (0.0, 0.0, 9.0)), False),  # at the sky
        (((-4000.0, 0.0, 1.0), (0.0, 0.0, 1.0)), False),  # a speck
        (((-9.0, 0.0, 1.0), (-9.0, 0.0, 1.0)), False),  # nowhere
        (((np.nan, 0.0, 1.0), (0.0, 0.0, 1.0)), False),
    ],
)
def test_a_view_shows_a_place_of_which_more_than_a_speck_is_in_the_page(view: View, seen: bool, scale: float) -> None:
    (eye, target), corners = scale * np.array(view), scale * np.array(_BOX)
    assert is_visible((tuple(eye.tolist()), tuple(target.tolist())), *corners.tolist()) is seen

"""From where a place is looked at first."""

import numpy as np
import pytest

from nerfnav_app.places.vantage import FOV, View, is_visible, view_of_box, view_of_ends, view_of_whole_box

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


@pytest.mark.parametrize("size", [(3.4, 2.0, 1.4), (1.0, 1.0, 3.0), (20.0, 2.0, 0.5), (0.5, 9.0, 1.0), (2.0, 2.0, 2.0)])
def test_all_of_a_box_is_on_a_page_that_is_as_wide_as_high(size: tuple[float, float, float]) -> None:
    lower, upper = np.array([-7.0, 3.0, 1.0]), np.array([-7.0, 3.0, 1.0]) + size
    eye, target = (np.array(point) for point in view_of_whole_box(tuple(lower.tolist()), tuple(upper.tolist())))
    ahead = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(ahead, [0, 0, 1]) / np.linalg.norm(np.cross(ahead, [0, 0, 1]))
    corners = lower + np.array(list(np.ndindex(2, 2, 2))) * size - eye
    beside = abs(corners @ np.stack([right, np.cross(right, ahead)], 1)) / (corners @ ahead)[:, None]
    largest = beside.max() / np.tan(FOV / 2)
    assert 0.7 < largest < 1, "it fills the page, and is not cut by its edge"


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

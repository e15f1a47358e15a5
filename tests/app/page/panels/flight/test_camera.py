"""What the camera panel shows."""

from dataclasses import replace

import numpy as np
import torch

from nerfnav.navigation import NavigationStep
from nerfnav_app.page.kit.chart import FlightRows, error_curves, time_curves
from nerfnav_app.page.kit.theme import BELIEF, HIT
from nerfnav_app.page.panels.flight.camera import beside, compose, difference, with_pixels
from nerfnav_app.queries.robot_view import RobotViewQuery
from nerfnav_app.state.flight import FlightRecord
from tests.app.doubles import filter_step, flight_step
from tests.app.page.test_panels_and_layers import ENDS

GREY = np.full((20, 30, 3), 90, np.uint8)


def test_pictures_stand_side_by_side_with_a_gap() -> None:
    assert beside(GREY, GREY[:10]).shape == (20, 66, 3)


def test_the_difference_is_black_where_pictures_agree_and_amplified_elsewhere() -> None:
    other = GREY.copy()
    other[3, 4, 1] += 20
    apart = difference(GREY, other)
    assert apart[3, 4].tolist() == [60, 60, 60]
    apart[3, 4] = 0
    assert not apart.any()


def test_compared_pixels_are_marked_and_rejected_ones_are_red() -> None:
    pixels = torch.tensor([[5, 2], [29, 19], [300, 2]])
    believed = torch.tensor([True, False, True])
    step = replace(filter_step(ENDS, 0), pixels=pixels, residual=torch.zeros(3), believed=believed)
    marked = with_pixels(GREY, step)
    assert tuple(marked[2, 5]) == BELIEF
    assert tuple(marked[19, 29]) == HIT
    assert (marked != GREY).any(-1).sum() == 2, "a pixel outside the picture marks nothing"


def test_a_flight_shows_picture_field_and_difference_and_ends_show_the_field_alone() -> None:
    flight = FlightRecord(ENDS).with_step(flight_step(ENDS, 0)).with_step(flight_step(ENDS, 1))
    seen, ends = RobotViewQuery(("flight", 1, 2), ()), RobotViewQuery(("ends", ENDS), ())
    caption, picture = compose((GREY,), seen.step_of(flight))
    assert "difference" in caption and picture.shape == (20, 3 * 30 + 12, 3)
    assert compose((GREY, GREY), ends.step_of(flight))[1].shape == (20, 66, 3)


def test_curves_tell_error_expectation_and_times() -> None:
    steps = tuple(flight_step(ENDS, k) for k in range(3))
    time, error, expected = error_curves(steps)
    assert np.allclose(time, [0, 0.1, 0.2])
    assert np.allclose(error, 1.0, atol=1e-3), "the double's belief is a centimetre off"
    assert np.allclose(expected, 100 * 3 * np.sqrt(6e-4), rtol=1e-4)
    assert np.allclose(time_curves(steps)[1:, 0], [1.0, 2.0, 100.0])
    assert error_curves(()).shape == (3, 0)


def test_of_a_flight_that_has_grown_only_the_new_steps_are_asked_for() -> None:
    steps, asked = tuple(flight_step(ENDS, k) for k in range(5)), []

    def watched(some: tuple[NavigationStep, ...]) -> np.ndarray:
        asked.append(len(some))
        return error_curves(some)

    rows = FlightRows(watched)
    for shown in (steps[:2], steps[:3], steps, steps, steps[:4], steps[2:], (), steps):
        assert np.array_equal(rows.of(shown), error_curves(shown))
    assert [count for count in asked if count] == [2, 1, 2, 4, 3, 5]

"""Check of a given camera against the field: the right one passes, a wrong one is named."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from nerfnav.core.errors import InvalidInputError
from nerfnav.estimator import ColorNoise
from nerfnav.geometry import Camera
from nerfnav.tracking import Frame, Sighting, Tracker, TrackerConfig, check_camera, fit_focal_length
from nerfnav.tracking.camera_check import CameraFit, _vertex
from tests.tracking.walks import CAMERA, every, field, pose, walk

NOISE = ColorNoise(0.01)
FRAMES = walk(every(4, 0.3))
SIGHTINGS = [Sighting(frame.picture, pose(frame.time)) for frame in FRAMES]


@pytest.mark.parametrize("change", [-0.12, 0.0, 0.12])
def test_a_focal_length_is_fitted_beside_the_poses_and_a_wrong_one_is_told(change: float) -> None:
    fit = fit_focal_length(field(), CAMERA.magnified(math.exp(-change)), SIGHTINGS, NOISE)
    assert fit.change == pytest.approx(change, abs=0.01) and fit.clear
    assert fit.ok == (change == 0)
    assert fit.fitted.horizontal_fov_deg == pytest.approx(80, abs=1)
    assert (" not " in fit.sentence) == (change != 0)


def test_the_camera_of_the_fields_photographs_is_taken_where_it_agrees_with_the_fit() -> None:
    given, likely = CAMERA.magnified(1.12), CAMERA.resized(240, 192)
    fit = fit_focal_length(field(), given, SIGHTINGS, NOISE, likely)
    assert fit.fitted.fx == pytest.approx(CAMERA.fx) and fit.fitted.width == given.width
    elsewhere = fit_focal_length(field(), given, SIGHTINGS, NOISE, CAMERA.magnified(1.3))
    assert elsewhere.fitted.fx == pytest.approx(CAMERA.fx, rel=0.01)


def test_one_picture_tells_less_than_four() -> None:
    one, four = (fit_focal_length(field(), CAMERA, SIGHTINGS[:count], NOISE) for count in (1, 4))
    assert one.std > four.std
    with pytest.raises(InvalidInputError, match="there is none"):
        fit_focal_length(field(), CAMERA, [], NOISE)


@pytest.mark.slow
def test_a_camera_that_is_not_found_as_given_is_found_with_another_focal_length() -> None:
    tracker = Tracker(field(), CAMERA.magnified(1.35), config=TrackerConfig(filter=replace(
        TrackerConfig().filter, color_noise=NOISE)))  # fmt: skip
    fit = check_camera(tracker, lambda: iter(FRAMES), CAMERA)
    assert fit is not None and not fit.ok and fit.fitted.fx == pytest.approx(CAMERA.fx)


def test_pictures_in_which_nothing_is_found_tell_nothing() -> None:
    tracker, black = Tracker(field(), CAMERA), [replace(frame, picture=0 * frame.picture) for frame in FRAMES]
    assert check_camera(tracker, lambda: iter(black)) is None


def test_a_source_that_breaks_off_is_checked_by_what_came() -> None:
    def frames() -> Iterator[Frame]:
        yield from FRAMES[:2]
        raise InvalidInputError("it breaks off")

    fit = check_camera(Tracker(field(), CAMERA), frames)
    assert fit is not None and fit.ok and fit.pictures == 2


def test_the_vertex_of_a_parabola_has_its_curvatures_deviation_or_that_of_the_jackknife() -> None:
    x, step = np.array([-1.0, 0.0, 1.0])[:, None] * 0.05, 0.05
    alike = ((x - 0.01) / 0.02) ** 2 * np.ones((1, 4))
    assert _vertex(alike, step) == pytest.approx((0.01, 0.01))  # four pictures of 0.02 each
    apart = ((x - np.array([-0.03, 0.0, 0.02, 0.05])) / 0.02) ** 2
    assert _vertex(apart, step) == pytest.approx((0.01, np.std([-0.03, 0, 0.02, 0.05], ddof=1) / 2))
    assert _vertex(-alike, step)[1] == math.inf


def test_a_fit_without_a_minimum_refuses_only_what_fits_worse() -> None:
    fit = CameraFit(Camera.from_fov(640, 480, 60), 0.4, math.inf, gain=50.0, pictures=4)
    assert not fit.ok and not fit.clear
    assert replace(fit, gain=3.0).ok

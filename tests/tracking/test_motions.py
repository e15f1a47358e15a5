"""Tracking with an inertial measurement unit, against tracking by a hand's motion."""

from dataclasses import replace

import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.field import FieldInfo
from nerfnav.geometry import FORWARD_MOUNT, so3
from nerfnav.tracking import InertialMotion, TrackedFrame, Tracker, TrackerConfig, TrackStatus
from tests.tracking.shaken import BIASES, MOUNT, Shaken
from tests.tracking.walks import CAMERA, every, field

CONFIG = TrackerConfig()
CONFIG = replace(CONFIG, filter=CONFIG.filter.for_field(FieldInfo(noise_std=0.01)))
QUICK = Shaken(turning=0.4, turns=1.8)
"""Up to 4.5 rad/s."""


def led(shaken: Shaken, end: float = 2.6) -> Tracker:
    unit = InertialMotion(shaken.measured(end))
    return Tracker(field(), CAMERA, mount=MOUNT, config=CONFIG, inertial=unit)


def well_tracked(tracked: TrackedFrame, shaken: Shaken) -> bool:
    true, found = shaken.pose(tracked.time), tracked.pose
    if found is None or not tracked.status.updated:
        return False
    moved = (found.position.double() - true.position).norm()
    return bool(moved < 0.01 and so3.local(true.rotation, found.rotation.double()).norm() < 0.01)


@pytest.mark.slow
def test_quick_turns_are_followed_at_five_pictures_in_a_second_and_the_biases_learned() -> None:
    one, frames = led(QUICK), QUICK.frames(every(13, dt=0.2))
    track = [one.observe(frame) for frame in frames]
    assert [tracked.status for tracked in track] == [TrackStatus.FOUND, *[TrackStatus.FOLLOWED] * 12]
    assert all(well_tracked(tracked, QUICK) for tracked in track[1:])
    assert isinstance(one.motion, InertialMotion) and one.motion.last is not None
    off, std = one.motion.last.biases - BIASES, one.motion.last.covariance.diagonal().sqrt()
    assert (off.abs() < 4 * std[:6]).all() and off[:3].abs().max() < 0.01 < BIASES[:3].abs().max()
    by_hand = Tracker(field(), CAMERA, mount=FORWARD_MOUNT, config=CONFIG)
    assert not all(well_tracked(by_hand.observe(frame), QUICK) for frame in frames[:8])


@pytest.mark.slow
def test_its_covariance_holds_its_errors() -> None:
    shaken = Shaken()
    one = led(shaken, 1.2)
    for tracked in [one.observe(frame) for frame in shaken.frames(every(12))][1:]:
        found, true = tracked.pose, shaken.pose(tracked.time)
        assert found is not None and tracked.covariance is not None
        turn = so3.log(true.rotation @ found.rotation.T.double())
        error = torch.cat([true.position - found.position.double(), turn])
        assert error @ torch.linalg.solve(tracked.covariance, error) < 30  # chi-squared of 6: 1 in 25,000


@pytest.mark.slow
def test_after_the_track_was_lost_the_biases_are_still_known() -> None:
    shaken = Shaken()
    one, frames = led(shaken), shaken.frames(every(18))
    for index, frame in enumerate(frames[:14]):
        dark = replace(frame, picture=torch.zeros_like(frame.picture))
        one.observe(dark if index >= 8 else frame)
    assert isinstance(one.motion, InertialMotion) and one.motion.last is not None
    known = one.motion.last.covariance[0, 0]
    assert one._belief is None
    assert one.observe(frames[14]).status is TrackStatus.FOUND_AGAIN
    assert all(well_tracked(one.observe(frame), shaken) for frame in frames[15:])
    assert one.motion.last.covariance[0, 0] <= 1.01 * known < one.motion.config.gyro_bias**2
    one.forget()
    assert one.motion.last is None


def test_measurements_of_another_time_are_refused() -> None:
    unit = InertialMotion(QUICK.measured(1.0))
    for time in (-0.5, 1.5):
        with pytest.raises(InvalidInputError, match=r"from -0\.200 s to 0\.995 s: they must be of the same time"):
            unit.check(time)
    unit.check(0.5)


def test_measurements_that_end_before_the_pictures_are_told() -> None:
    one, frames = led(QUICK, 0.3), QUICK.frames(every(3, dt=0.2))
    one.observe(frames[0])
    one.observe(frames[1])
    with pytest.raises(InvalidInputError, match=r"between 0\.200 s and 0\.400 s the inertial measurements have a gap"):
        one.observe(frames[2])

"""The tracker, on pictures of a small place that is known exactly."""

from dataclasses import replace

import cv2
import pytest
import torch
from jaxtyping import UInt8
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.estimator import Belief
from nerfnav.field import FieldInfo
from nerfnav.field.core.occupancy import DENSITY_SCALE
from nerfnav.field.models.levels import raw_of
from nerfnav.geometry import FORWARD_MOUNT, Box, Camera, Pose, so3
from nerfnav.robots import RigidState
from nerfnav.tracking import Frame, TrackedFrame, Tracker, TrackerConfig, TrackStatus
from tests.tracking.walks import CAMERA, DT, every, field, picture, pose, walk

CONFIG = TrackerConfig()
CONFIG = replace(CONFIG, filter=CONFIG.filter.for_field(FieldInfo(noise_std=0.01)))


def tracker(camera: Camera = CAMERA, config: TrackerConfig = CONFIG) -> Tracker:
    return Tracker(field(), camera, config=config)


def errors(tracked: TrackedFrame) -> tuple[float, float]:
    """Position [m] and attitude [rad]."""
    true, found = pose(tracked.time), tracked.pose
    assert found is not None
    return float((found.position - true.position).norm()), float(so3.local(true.rotation, found.rotation).norm())


def blur(image: UInt8[Tensor, "height width 3"]) -> UInt8[Tensor, "height width 3"]:
    return torch.from_numpy(cv2.GaussianBlur(image.numpy(), (0, 0), 3.0))


def well_tracked(tracked: TrackedFrame) -> bool:
    moved, turned = errors(tracked)
    return tracked.status.updated and moved < 0.01 and turned < 0.01


@pytest.mark.slow
def test_a_camera_is_found_from_nothing_and_followed() -> None:
    one = tracker()
    track = [one.observe(frame) for frame in walk(every(8))]
    assert [tracked.status for tracked in track] == [TrackStatus.FOUND, *[TrackStatus.FOLLOWED] * 7]
    assert all(map(well_tracked, track[1:]))
    assert [tracked.time for tracked in track] == every(8)


@pytest.mark.slow
def test_frames_may_come_at_any_times() -> None:
    one = tracker()
    assert all(well_tracked(one.observe(frame)) for frame in walk([0.0, 0.07, 0.1, 0.5, 0.53, 1.1]))


@pytest.mark.slow
def test_its_covariance_holds_its_errors() -> None:
    one = tracker()
    track = [one.observe(frame) for frame in walk(every(10))][1:]
    for tracked in track:
        found, true = tracked.pose, pose(tracked.time)
        assert found is not None and tracked.covariance is not None
        turn = so3.log(true.rotation @ found.rotation.T)
        error = torch.cat([true.position - found.position, turn]).double()
        assert error @ torch.linalg.solve(tracked.covariance, error) < 30  # chi-squared of 6: 1 in 25,000


@pytest.mark.slow
def test_pictures_of_another_resolution_of_the_camera_are_tracked() -> None:
    one, small = tracker(), CAMERA.scaled(0.5)
    frames = [*walk([0.0, 0.07]), *walk([0.2, 0.25], small), *walk([0.3], CAMERA.scaled(2))]
    assert all(well_tracked(one.observe(frame)) for frame in frames)


@pytest.mark.slow
def test_black_frames_lose_the_track_and_a_picture_finds_it_again() -> None:
    one, frames = tracker(), walk(every(16))
    dark = [replace(frame, picture=torch.zeros_like(frame.picture)) for frame in frames[3:13]]
    status = [one.observe(frame).status for frame in [*frames[:3], *dark]]
    assert status[3:] == [TrackStatus.PREDICTED] * 2 + [TrackStatus.LOST] * 8
    again = one.observe(frames[13])
    assert again.status is TrackStatus.FOUND_AGAIN and errors(again)[0] < 0.02


@pytest.mark.slow
def test_a_jump_is_never_followed_elsewhere_and_the_camera_soon_where_it_is() -> None:
    one = tracker()
    for frame in walk(every(4)):
        one.observe(frame)
    there = RigidState.at_rest((-0.45, 0.25, 0.3), -0.5).pose.compose(FORWARD_MOUNT)
    seen = picture(field(), CAMERA, there)
    track = [one.observe(Frame(time, seen, "there")) for time in every(8, first=4 / 15)]
    assert all(one.status.updated for one in track[3:])
    assert any(one.pose is not None for one in track)
    for told in (one.pose for one in track if one.pose is not None):
        assert (told.position - there.position).norm() < 0.02


@pytest.mark.slow
def test_a_picture_that_was_not_taken_around_tells_no_pose_and_the_next_one_goes_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    one, frames = tracker(), walk(every(8))
    for frame in frames[:4]:
        one.observe(frame)
    monkeypatch.setattr(Tracker, "_look_everywhere", lambda *_: None)
    covered = one.observe(replace(frames[4], picture=frames[4].picture.flip(0, 1)))
    assert covered.status is TrackStatus.LOST and covered.pose is None and covered.covariance is None
    track = [one.observe(frame) for frame in frames[5:]]
    assert [tracked.status for tracked in track] == [TrackStatus.FOUND_AGAIN, *[TrackStatus.FOLLOWED] * 2]
    assert all(map(well_tracked, track))


@pytest.mark.slow
def test_a_pose_that_shows_most_of_a_picture_is_believed_where_no_other_place_fits_better() -> None:
    one, frames = tracker(), walk(every(10))
    for frame in frames[:4]:
        one.observe(frame)
    sharp = one._usual.difference
    blurred = [replace(frame, picture=blur(frame.picture)) for frame in frames[4:]]
    track = [one.observe(frame) for frame in blurred]
    assert track[0].difference is not None and track[0].difference > CONFIG.suspicious * sharp
    assert {tracked.status for tracked in track} == {TrackStatus.FOLLOWED}
    assert max(errors(tracked)[0] for tracked in track) < 0.03


@pytest.mark.slow
def test_an_excursion_of_15_cm_is_noticed() -> None:
    one, frames = tracker(), walk(every(10))
    for frame in frames[:5]:
        one.observe(frame)
    assert one._belief is not None
    away = one._belief.mean.retract(torch.tensor([0.1, 0.1, 0.05] + 9 * [0.0]))
    one._belief = Belief(away, one._belief.covariance)
    assert errors([one.observe(frame) for frame in frames[5:]][-1])[0] < 0.02


@pytest.mark.slow
def test_an_excursion_is_over_with_the_next_picture_and_without_a_search(monkeypatch: pytest.MonkeyPatch) -> None:
    one, frames = tracker(), walk(every(8))
    for frame in frames[:5]:
        one.observe(frame)
    monkeypatch.setattr(Tracker, "_search", lambda *_: pytest.fail("the picture was looked for everywhere"))
    assert one._belief is not None
    away = one._belief.mean.retract(torch.tensor([0.06, 0.06, 0.03, *[0.0] * 9]))
    one._belief = Belief(away, one._belief.covariance)
    assert all(well_tracked(one.observe(frame)) for frame in frames[5:])


@pytest.mark.parametrize("scale", [0.1, 10.0])
def test_a_place_of_any_size_is_tracked_alike(scale: float) -> None:
    place, density = field(), DENSITY_SCALE * torch.nn.functional.softplus(field().values[..., 0]) / scale
    box = Box(scale * place.box.lower, scale * place.box.upper)
    values = torch.cat([raw_of(density)[..., None], place.values[..., 1:]], -1)
    one = Tracker(replace(place, box=box, values=values), CAMERA, config=CONFIG)
    frames = walk(every(6))
    body = pose(0.0).compose(Pose(FORWARD_MOUNT.rotation.T, torch.zeros(3)))
    state = replace(RigidState.at_rest((0.0, 0.0, 0.0)), position=scale * body.position, rotation=body.rotation)
    one._belief, one._time = Belief(state, one.config.found.covariance()), -DT
    for frame in frames:
        tracked = one.observe(frame)
        assert tracked.status is TrackStatus.FOLLOWED and tracked.pose is not None
        assert (tracked.pose.position / scale - pose(frame.time).position).norm() < 0.01


@pytest.mark.slow
def test_what_does_not_average_out_stays_in_the_covariance() -> None:
    floor = torch.diag(torch.tensor([0.03**2, 0.02**2, 0.01**2, 1e-4, 1e-4, 1e-4], dtype=torch.float64))
    one = tracker(config=replace(CONFIG, floor=tuple(floor.flatten().tolist())))
    tracked = [one.observe(frame) for frame in walk(every(6))][-1]
    covariance, found = tracked.covariance, tracked.pose
    assert covariance is not None and found is not None
    in_camera = found.rotation.T.double() @ covariance[:3, :3] @ found.rotation.double()
    assert (in_camera.diagonal() >= floor.diagonal()[:3] * 0.99).all()
    assert in_camera[0, 0] < 2 * floor[0, 0]


def test_time_must_go_on() -> None:
    one, frames = tracker(), walk([0.0, 0.1])
    one.observe(frames[1])
    with pytest.raises(InvalidInputError, match="in the order of their times"):
        one.observe(frames[0])


def test_a_picture_of_other_proportions_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="neither cut nor turned"):
        tracker().observe(walk([0.0], CAMERA.resized(96, 120))[0])

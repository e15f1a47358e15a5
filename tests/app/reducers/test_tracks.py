"""Tracks of cameras, as the session has them."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch

from nerfnav.estimator import Belief
from nerfnav.geometry import FORWARD_MOUNT
from nerfnav.robots import RigidState, StateNoise
from nerfnav.tracking import TrackedFrame, TrackStatus
from nerfnav_app.jobs.events import FrameTracked, JobFinished, JobResult
from nerfnav_app.page.panels.flight.camera import tracked_pictures
from nerfnav_app.page.panels.flight.track import STATUS_LABELS, describe, summarize_track
from nerfnav_app.page.panels.status.timeline import list_marks, nearest
from nerfnav_app.state import actions as m
from nerfnav_app.state.job import JobKind
from nerfnav_app.state.runs import PlayBack, Scrub
from nerfnav_app.state.session import Session
from nerfnav_app.state.tracks import RemoveTrack, StartTrack
from tests.app.sessions import after, planned, reports

START = StartTrack(Path("walk.mp4"), "walk.mp4", fps=5.0)
SEEN = torch.full((6, 8, 3), 90, dtype=torch.uint8)


def frame(time: float, status: TrackStatus = TrackStatus.FOLLOWED) -> FrameTracked:
    """A frame of a camera that goes along x."""
    state = RigidState.at_rest((0.1 * time, 0.0, 0.3), 0.0)
    belief = Belief(state, StateNoise(0.02, 0.1, 0.01, 0.1).covariance()) if status.knows else None
    tracked = TrackedFrame(time, f"at {time}", status, belief, FORWARD_MOUNT, 30.0, 0.05 if status.knows else None)
    return FrameTracked(tracked, SEEN, SEEN // 2 if status.knows else None)


def tracked(opened: Session) -> Session:
    """After four frames at uneven times, one of them lost."""
    frames = (frame(3.0, TrackStatus.FOUND), frame(3.1), frame(3.5, TrackStatus.LOST))
    return reports(after(opened, START), *frames, frame(4.0, TrackStatus.FOUND_AGAIN))


def test_a_track_takes_the_place_of_a_flight(opened: Session) -> None:
    session = after(opened, START)
    assert session.job is not None and session.job.kind is JobKind.TRACK and session.job.track == START
    assert session.flight is None and session.track is not None and session.timed is session.track
    assert after(session, START).track is session.track, "one at a time"


def test_frames_come_one_after_the_other_and_a_stopped_track_stays(opened: Session) -> None:
    session = tracked(opened)
    assert session.track is not None and session.track.times == pytest.approx((0.0, 0.1, 0.5, 1.0))
    stopped = after(session, m.Cancel())
    assert stopped.job is None and stopped.track is session.track
    assert after(stopped, RemoveTrack()).track is None
    assert after(session, RemoveTrack()).track is session.track, "not while it grows"


def test_a_finished_track_is_told_with_its_numbers(opened: Session) -> None:
    session = reports(tracked(opened), JobFinished("track", JobResult({"lost": 1})))
    assert session.track is not None and session.job is None
    assert summarize_track(session.track) == "Tracked walk.mp4: 3 of 4 frames, lost once"


def test_the_timeline_goes_along_a_track_by_its_own_times(opened: Session) -> None:
    session = after(tracked(opened), m.Cancel())
    assert session.track is not None
    early = after(session, Scrub(1))
    assert early.shown_track is not None and len(early.shown_track.steps) == 2
    playing = after(session, Scrub(0), PlayBack(True), m.Tick(0.45))
    assert playing.shown_track is not None and len(playing.shown_track.steps) == 2
    done = after(playing, m.Tick(0.6))
    assert done.shown_track is not None and len(done.shown_track.steps) == 4 and not done.runs.timeline.playing
    times, words = zip(*list_marks(session.track), strict=True)
    assert words == ("found", "lost", "found") and times == pytest.approx((0.0, 0.5, 1.0))


def test_a_flight_takes_the_place_of_a_track(opened: Session) -> None:
    session = after(planned(after(tracked(opened), m.Cancel())), m.StartFlight())
    assert session.track is None and session.flight is not None


def test_pictures_of_a_frame_stand_side_by_side_and_an_unknown_one_is_black(opened: Session) -> None:
    steps = tracked(opened).track
    assert steps is not None
    seen, lost = tracked_pictures(steps.steps[1]), tracked_pictures(steps.steps[2])
    assert seen.shape == lost.shape == (6, 3 * 8 + 2 * 6, 3)
    assert abs(int(seen[3, 4, 0]) - 90) < 3 and abs(int(seen[3, 18, 0]) - 45) < 3 and lost[3, 18, 0] == 0


def test_words_tell_what_became_of_the_frames(opened: Session) -> None:
    session = tracked(opened)
    assert session.track is not None
    html = describe(session.track, session.shown_track)
    for status in (TrackStatus.LOST, TrackStatus.FOUND_AGAIN):
        assert STATUS_LABELS[status] in html
    empty = replace(session.track, steps=())
    assert "cm" in html and len({html, describe(empty, empty), describe(None, None)}) == 3


@pytest.mark.parametrize(("time", "index"), [(-1.0, 0), (0.0, 0), (0.06, 1), (0.2, 1), (0.4, 2), (9.0, 2)])
def test_the_nearest_of_uneven_times_is_found(time: float, index: int) -> None:
    assert nearest((0.0, 0.1, 0.5), time) == index

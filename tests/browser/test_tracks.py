"""A camera that is followed, from a video that somebody brings to the page."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from nerfnav.field import VoxelField
from nerfnav.geometry import Camera
from nerfnav_app.places.place import Place
from nerfnav_app.server import App
from tests.app.doubles import balls_place
from tests.browser.tab import Tab
from tests.browser.works import small_work
from tests.tracking.walks import DT, every, picture, pose

Serve = Callable[..., App]
OpenTab = Callable[[App], Tab]
CAMERA = Camera.from_fov(120, 96, 90)
"""What a page takes a camera for that nobody knows."""


def sure_place() -> Place:
    """Three balls whose colours are nearly right: what shows of them tells where a camera is."""
    place = balls_place()
    assert isinstance(place.field, VoxelField)
    return replace(place, field=replace(place.field, info=replace(place.field.info, noise_std=0.02)))


@pytest.fixture
def video(tmp_path: Path) -> Callable[..., Path]:
    """Writes a video of so many frames, then of the way back and so on, as many times as asked."""
    field = sure_place().field
    assert isinstance(field, VoxelField)

    def write(count: int, times: int = 1) -> Path:
        path = tmp_path / "walk.mp4"
        writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 1 / DT, (CAMERA.width, CAMERA.height))
        frames = [picture(field, CAMERA, pose(time)).numpy()[..., ::-1].copy() for time in every(count)]
        for turn in range(times):
            for frame in frames if turn % 2 == 0 else reversed(frames):
                writer.write(frame)
        writer.release()
        return path

    return write


def frames(app: App) -> int:
    """How many were looked at so far."""
    return 0 if app.session.track is None else len(app.session.track.steps)


def test_a_video_is_tracked_watched_again_and_its_trajectory_taken_away(
    serve: Serve, open_tab: OpenTab, video: Callable[..., Path]
) -> None:
    app = serve(small_work(sure_place))
    tab = open_tab(app)
    tab.turn_to("Estimate")
    tab.upload("track.upload", video(12))
    tab.until(lambda: frames(app) > 2, "no frame is tracked", 180)
    tab.until(lambda: app.session.job is None, "it does not end", 180)
    track = app.session.track
    assert track is not None and [step.tracked.status.knows for step in track.steps] == 12 * [True]
    for step in track.steps:
        assert step.tracked.pose is not None
        assert (step.tracked.pose.position - pose(step.time).position).norm() < 0.03
    tab.until(lambda: tab.is_visible("/track/camera") and tab.is_visible("/track/covariance"), "nothing is drawn")
    drawn = 11 * 2 * 3
    tab.until(lambda: np.array(tab.property("/track/path", "points")).size == drawn, "the path is not drawn to its end")
    tab.page.get_by_text("Tracked walk.mp4: 12 of 12 frames, never lost").first.wait_for()
    text = tab.download("track.downloads.trajectory.tum").read_text().splitlines()
    assert len(text) == 13 and text[0].startswith("#")
    assert tab.download("track.downloads.poses.csv").read_text().count("\n") == 13
    played = tab.shown.watch(lambda session: session.shown_track is not track)
    tab.press("timeline.play")
    tab.until(played.is_set, "it does not play")
    tab.until(lambda: not app.session.runs.timeline.playing, "it does not end")
    tab.press("track.remove")
    tab.until(lambda: not tab.is_visible("/track/path"), "it stays on the page")


def test_a_track_that_is_stopped_keeps_what_it_has(
    serve: Serve, open_tab: OpenTab, video: Callable[..., Path]
) -> None:
    app = serve(small_work(sure_place))
    tab = open_tab(app)
    tab.turn_to("Estimate")
    tab.upload("track.upload", video(60, times=20))  # minutes, for a press of a busy browser may take seconds
    tab.until(lambda: frames(app) > 0, "no frame is tracked", 180)
    tab.press("status.next.cancel")
    tab.until(lambda: app.session.job is None, "it goes on")
    kept = frames(app)
    assert 0 < kept < 20 * 60
    tab.until(lambda: tab.is_visible("/track/camera"), "what was tracked is gone")


def test_what_is_no_video_is_refused_in_a_sentence(serve: Serve, open_tab: OpenTab, tmp_path: Path) -> None:
    (tmp_path / "broken.mp4").write_bytes(b"no video")
    app = serve(small_work(sure_place))
    tab = open_tab(app)
    tab.turn_to("Estimate")
    tab.upload("track.upload", tmp_path / "broken.mp4")
    tab.until(lambda: app.session.trouble is not None, "nothing is said")
    trouble = app.session.trouble
    assert trouble is not None and "cannot be read as a video" in trouble.body and str(tmp_path) not in trouble.body

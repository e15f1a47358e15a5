"""A video: its sharpest frames are picked, and where nothing can find their poses one sentence says what would."""

import os
import stat
import struct
from pathlib import Path

import cv2
import numpy as np
import pytest

from nerfnav.importers.captures import video as video_module
from nerfnav.importers.captures.formats import read_views
from nerfnav.importers.captures.video import VideoConfig, make_capture_of_video, pick_frames, sharpness
from nerfnav.importers.captures.views import CaptureError


def pattern(seed: int, size: tuple[int, int] = (120, 160)) -> np.ndarray:
    """A picture with much detail (height, width, 3)."""
    rng = np.random.default_rng(seed)
    coarse = rng.integers(0, 255, (size[0] // 8, size[1] // 8, 3), dtype=np.uint8)
    return cv2.resize(coarse, (size[1], size[0]), interpolation=cv2.INTER_NEAREST)


def write_video(path: Path, frames: list[np.ndarray]) -> Path:
    height, width = frames[0].shape[:2]
    kind = {".avi": "MJPG", ".mp4": "mp4v"}[path.suffix]
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*kind), 30, (width, height))
    for frame in frames:
        writer.write(frame)
    writer.release()
    return path


def shaky(count: int, sharp_every: int) -> list[np.ndarray]:
    """Frames of which one of so many is sharp; its upper left corner is white."""
    frames = []
    for index in range(count):
        frame = pattern(index // sharp_every)
        is_sharp = index % sharp_every == sharp_every // 2
        if not is_sharp:
            frame = cv2.GaussianBlur(frame, (0, 0), 4)
        frame[:16, :16] = 255 if is_sharp else 0
        frames.append(frame)
    return frames


def test_motion_blur_lowers_sharpness_at_any_size() -> None:
    for size in ((120, 160), (1080, 1920)):
        frame = cv2.resize(pattern(0), size[::-1], interpolation=cv2.INTER_NEAREST)
        across = np.zeros((1, 41), np.float32) + 1 / 41
        assert sharpness(cv2.filter2D(frame, -1, across[:, ::3] * 3)) < 0.7 * sharpness(frame)


@pytest.mark.parametrize("suffix", [".avi", ".mp4"])
def test_the_sharpest_frame_of_each_span_is_picked(suffix: str, tmp_path: Path) -> None:
    video = write_video(tmp_path / f"walk{suffix}", shaky(60, 5))
    fractions = list(pick_frames(video, tmp_path / "images", VideoConfig(frames=12)))
    assert fractions == sorted(fractions) and fractions[-1] == pytest.approx(1.0)
    files = sorted((tmp_path / "images").iterdir())
    assert len(files) == 12
    corners = [float(cv2.imread(str(file))[4:12, 4:12].mean()) for file in files]
    assert min(corners) > 200, "every picked frame is one of the sharp ones"


def test_a_short_video_gives_all_its_frames_and_one_that_is_too_short_is_refused(tmp_path: Path) -> None:
    video = write_video(tmp_path / "short.avi", shaky(10, 1))
    assert len(list(pick_frames(video, tmp_path / "all", VideoConfig(frames=100)))) == 10
    with pytest.raises(CaptureError, match="has 10 frames; at least 20 are needed"):
        list(pick_frames(video, tmp_path / "few", VideoConfig(frames=100, least_frames=20)))


def test_what_is_no_video_is_reported(tmp_path: Path) -> None:
    (tmp_path / "a.mp4").write_bytes(b"<!doctype html><html></html>")
    with pytest.raises(CaptureError, match="cannot be read as a video: it is a web page"):
        list(pick_frames(tmp_path / "a.mp4", tmp_path / "images"))


def test_a_video_that_ends_in_the_middle_says_so(tmp_path: Path) -> None:
    video = write_video(tmp_path / "walk.mp4", shaky(60, 5))
    whole = video.read_bytes()
    video.write_bytes(whole[: len(whole) // 2])  # the index of an mp4 stands at its end
    with pytest.raises(CaptureError, match="cut off"):
        list(pick_frames(video, tmp_path / "images"))
    video = write_video(tmp_path / "walk.avi", shaky(60, 5))
    whole = video.read_bytes()
    video.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(CaptureError, match="is cut off: it declares 60 frames"):
        list(pick_frames(video, tmp_path / "images"))


def test_without_anything_that_finds_poses_one_sentence_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(video_module.importlib.util, "find_spec", lambda name: None)
    video = write_video(tmp_path / "walk.avi", shaky(20, 2))
    with pytest.raises(CaptureError, match=r"a video has no poses, .*install COLMAP .*pip install pycolmap"):
        list(make_capture_of_video(video, tmp_path / "capture"))
    assert not (tmp_path / "capture").exists(), "it is reported before long work"


MAPPER = """#!/bin/sh
[ "$1" = "$FAILS_AT" ] && { echo "no GPU here" >&2; exit 3; }
[ "$1" = mapper ] || exit 0
while [ $# -gt 0 ]; do [ "$1" = --output_path ] && out="$2"; shift; done
cp -r "$MODELS"/* "$out"
"""
"""A program that takes COLMAP's commands and copies models that were made before."""


def stub_colmap(folder: Path, counts: dict[str, int], monkeypatch: pytest.MonkeyPatch) -> None:
    """Put a `colmap` on the path whose mapper makes a model of so many images under each name."""
    program = folder / "bin" / "colmap"
    program.parent.mkdir()
    program.write_text(MAPPER)
    program.chmod(program.stat().st_mode | stat.S_IEXEC)
    for name, count in counts.items():
        model = folder / "models" / name
        model.mkdir(parents=True)
        lens = struct.pack("<QiiQQ4d", 1, 1, 1, 160, 120, 120, 120, 80, 60)
        (model / "cameras.bin").write_bytes(lens)
        images = np.array([count], "<u8").tobytes()
        for index in range(count):
            images += np.array([index], "<i4").tobytes() + np.array([1.0, 0, 0, 0, index, 0, 0]).tobytes()
            images += np.array([1], "<i4").tobytes() + f"{index:05d}.jpg".encode() + b"\0" + bytes(8)
        (model / "images.bin").write_bytes(images)
    monkeypatch.setenv("PATH", f"{program.parent}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("MODELS", str(folder / "models"))


def test_the_largest_model_of_colmap_makes_the_frames_a_capture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stub_colmap(tmp_path, {"0": 2, "1": 9, "2": 3}, monkeypatch)
    video = write_video(tmp_path / "walk.avi", shaky(60, 5))
    steps = list(make_capture_of_video(video, tmp_path / "capture", VideoConfig(frames=12)))
    assert [step.fraction for step in steps] == sorted(step.fraction for step in steps) and steps[-1].fraction == 1
    found = read_views(tmp_path / "capture")
    assert found.kind == "COLMAP" and len(found.views) == 9 and all(view.exists for view in found.views)


def test_too_few_poses_and_a_colmap_that_fails_are_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stub_colmap(tmp_path, {"0": 2}, monkeypatch)
    video = write_video(tmp_path / "walk.avi", shaky(60, 5))
    with pytest.raises(CaptureError, match=r"found poses for 2 of 12 frames .*film slowly"):
        list(make_capture_of_video(video, tmp_path / "capture", VideoConfig(frames=12)))
    monkeypatch.setenv("FAILS_AT", "sequential_matcher")
    with pytest.raises(CaptureError, match="`colmap sequential_matcher` failed: no GPU here"):
        list(make_capture_of_video(video, tmp_path / "again", VideoConfig(frames=12)))

"""A video as a capture: sharp frames that overlap are chosen, and what cannot be posed says what to film otherwise."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from scipy.spatial.distance import pdist

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.steps import map_steps, run_steps
from nerfnav.geometry import Camera, look_at
from nerfnav.importers.captures.formats import read_views
from nerfnav.importers.captures.video import (
    ChosenFrame,
    VideoConfig,
    brightness,
    choose_frames,
    make_capture_of_video,
    sharpness,
)
from nerfnav.importers.captures.views import CaptureError
from nerfnav.importers.core.progress import SparseModel
from nerfnav.importers.sfm import posing
from nerfnav.world import MeshRenderer
from nerfnav_scenes import load
from tests.importers.core.test_video_frames import turn
from tests.importers.sfm import fake_posing


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


def pan(pixels_per_frame: float, distance: float = 240) -> list[np.ndarray]:
    """Frames that move over a wide picture by so many pixels in all."""
    wide = cv2.GaussianBlur(pattern(0, (120, 480)), (0, 0), 2)
    starts = np.arange(0, distance, pixels_per_frame).round().astype(int)
    return [np.ascontiguousarray(wide[:, start : start + 160]) for start in starts]


def read(path: Path) -> np.ndarray:
    picture = cv2.imread(str(path))
    assert picture is not None, f"{path} is missing"
    return picture


def chosen_of(video: Path, folder: Path, **options: float) -> list[ChosenFrame]:
    return run_steps(choose_frames(video, folder, VideoConfig(**options)))  # type: ignore[arg-type]


def test_motion_blur_lowers_sharpness_at_any_size() -> None:
    for size in ((120, 160), (1080, 1920)):
        frame = cv2.resize(pattern(0), size[::-1], interpolation=cv2.INTER_NEAREST)
        across = np.zeros((1, 41), np.float32) + 1 / 41
        blurred = cv2.filter2D(frame, -1, across[:, ::3] * 3)
        assert sharpness(brightness(blurred)) < 0.7 * sharpness(brightness(frame))


@pytest.mark.parametrize("suffix", [".avi", ".mp4"])
def test_the_sharpest_frame_of_each_window_is_chosen(suffix: str, tmp_path: Path) -> None:
    video = write_video(tmp_path / f"walk{suffix}", shaky(60, 5))
    chosen = chosen_of(video, tmp_path / "images")
    assert sorted((tmp_path / "images").iterdir()) == [frame.path for frame in chosen]
    assert [frame.path.name for frame in chosen] == [f"{index:06d}.jpg" for index in range(2, 60, 5)]
    corners = [float(read(frame.path)[4:12, 4:12].mean()) for frame in chosen]
    assert min(corners) > 200, "every chosen frame is one of the sharp ones"


def test_windows_end_where_the_picture_moved_on_however_fast_the_camera_is(tmp_path: Path) -> None:
    counts = [
        len(chosen_of(write_video(tmp_path / f"{speed}.mp4", pan(speed)), tmp_path / str(speed), step=0.05))
        for speed in (0.5, 2, 5)
    ]
    assert counts[0] == pytest.approx(240 / (0.05 * 200), abs=5), "steps of a twentieth of the diagonal"
    assert counts == pytest.approx(3 * counts[:1], abs=5)


def test_of_many_windows_neighbours_are_taken_together_and_the_sharpest_stay(tmp_path: Path) -> None:
    video = write_video(tmp_path / "walk.avi", shaky(225, 5))
    chosen = chosen_of(video, tmp_path / "images", frames=10)
    assert len(chosen) == 10 == len(list((tmp_path / "images").iterdir()))
    numbers = [int(frame.path.stem) for frame in chosen]
    assert numbers == sorted(numbers) and all(number % 5 == 2 for number in numbers), "these are the sharp ones"
    assert max(np.diff([0, *numbers, 225])) <= 50, "they lie evenly over the video"


def test_progress_tells_how_many_frames_were_chosen(tmp_path: Path) -> None:
    video = write_video(tmp_path / "walk.avi", shaky(60, 5))
    steps = list(choose_frames(video, tmp_path / "images"))
    assert [step.doing for step in steps][-1] == "choosing sharp frames: 11 so far"
    fractions = [step.fraction for step in steps]
    assert fractions == sorted(fractions) and fractions[-1] == pytest.approx(0.2 * 50 / 60)


def test_a_camera_that_stands_still_and_a_short_video_are_refused(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    noisy = [(pattern(0) + rng.normal(0, 4, (120, 160, 3))).clip(0, 255).astype(np.uint8) for _ in range(60)]
    with pytest.raises(CaptureError, match="has 60 frames, of which 1 differ, and 8 are needed: walk around"):
        chosen_of(write_video(tmp_path / "still.mp4", noisy), tmp_path / "still")
    video = write_video(tmp_path / "short.avi", shaky(10, 1))
    assert len(chosen_of(video, tmp_path / "all")) == 10
    with pytest.raises(CaptureError, match="has 10 frames, of which 10 differ, and 20 are needed"):
        chosen_of(video, tmp_path / "few", least_frames=20)


def test_frames_of_a_video_that_was_filmed_sideways_are_upright(tmp_path: Path) -> None:
    chosen = chosen_of(turn(write_video(tmp_path / "walk.mp4", shaky(40, 4))), tmp_path / "images")
    assert {read(frame.path).shape for frame in chosen} == {(160, 120, 3)}


def test_what_is_no_video_and_one_that_ends_in_the_middle_are_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "a.mp4").write_bytes(b"<!doctype html><html></html>")
    with pytest.raises(CaptureError, match="cannot be read as a video: it is a web page"):
        list(make_capture_of_video(tmp_path / "a.mp4", tmp_path / "capture"))
    for suffix, sentence in ((".mp4", "cut off"), (".avi", "is cut off: it declares 60 frames")):
        video = write_video(tmp_path / f"walk{suffix}", shaky(60, 5))
        whole = video.read_bytes()
        video.write_bytes(whole[: len(whole) // 2])  # the index of an mp4 stands at its end
        with pytest.raises(InvalidInputError, match=sentence):
            chosen_of(video, tmp_path / "images")


Poser = Callable[[Callable[..., fake_posing.Posing]], None]


@pytest.fixture
def poser(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Poser:
    """Puts another one in the place of structure from motion, and forgets what was posed before."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return lambda pose: monkeypatch.setattr(posing, "pose_pictures", pose)


def test_posed_frames_are_a_capture_and_progress_tells_how_many_there_are(poser: Poser, tmp_path: Path) -> None:
    poser(fake_posing.pose_all)
    video, steps = write_video(tmp_path / "walk.avi", shaky(60, 5)), []
    report = run_steps(map_steps(make_capture_of_video(video, tmp_path / "capture"), steps.append))
    assert (report.frames, report.frames_posed) == (12, 10)
    fractions = [step.fraction for step in steps]
    assert fractions == sorted(fractions) and fractions[-1] > 0.9
    labels = [step.doing for step in steps]
    assert "matching frames: 8 of 61 pairs" in labels and labels[-1] == "10 of 12 frames posed"
    assert "2 of 12 frames posed" not in labels, "a model that is given up takes nothing back"
    shown = [step.model for step in steps if step.model is not None]
    assert [len(model.poses) for model in shown] == [4, 2, 10, 10]
    found = read_views(tmp_path / "capture")
    assert found.kind == "COLMAP" and len(found.views) == 10 and all(view.exists for view in found.views)
    places = np.stack([view.pose[:3, 3] for view in found.views])
    assert places == pytest.approx(np.stack([0.1 * np.arange(10), np.zeros(10), np.zeros(10)], 1))
    assert found.views[0].lens.focal_u == pytest.approx(160 / 160)
    assert found.tracks is not None and len(found.tracks.points) == 100


def test_the_same_video_is_posed_once(poser: Poser, tmp_path: Path) -> None:
    poser(fake_posing.pose_all)
    video = write_video(tmp_path / "walk.avi", shaky(60, 5))
    first = run_steps(make_capture_of_video(video, tmp_path / "first"))
    poser(fake_posing.refuse)
    steps = list(make_capture_of_video(video, tmp_path / "again"))
    assert steps[-1].model is not None and steps[-1].fraction == 1
    assert steps[-1].doing == f"{first.frames_posed} of {first.frames} frames posed"
    poses = [[view.pose.tolist() for view in read_views(tmp_path / name).views] for name in ("first", "again")]
    assert poses[0] == poses[1]
    with pytest.raises(AssertionError, match="pictures are posed again"):
        other = write_video(tmp_path / "other.avi", shaky(50, 5))
        list(make_capture_of_video(other, tmp_path / "other"))


@pytest.mark.parametrize(
    ("pose", "sentence"),
    [
        (fake_posing.pose_few, "poses were found for 2 of 12 frames of .*walk.avi: its frames show .* from one place"),
        (fake_posing.pose_by_chance, "poses were found for 12 of 12 frames .* 60 features each, 150 are needed"),
        (fake_posing.pose_none, "poses were found for 0 of 12 frames .* 10% of its frames overlap"),
    ],
)
def test_a_video_that_cannot_be_posed_is_one_sentence_each_time(
    pose: Callable[..., fake_posing.Posing], sentence: str, poser: Poser, tmp_path: Path
) -> None:
    poser(pose)
    video = write_video(tmp_path / "walk.avi", shaky(60, 5))
    for attempt in ("first", "again"):
        with pytest.raises(CaptureError, match=sentence) as error:
            list(make_capture_of_video(video, tmp_path / attempt))
        assert "\n" not in str(error.value)


@pytest.mark.parametrize(("size", "sentence"), [((240, 320), "0% of its frames overlap"), ((16, 16), "0 features")])
def test_frames_of_noise_have_no_poses(
    size: tuple[int, int], sentence: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    rng = np.random.default_rng(0)
    video = write_video(tmp_path / "noise.avi", [rng.integers(0, 255, (*size, 3), dtype=np.uint8) for _ in range(12)])
    with pytest.raises(CaptureError, match=f"poses were found for 0 of 12 frames of .*: .*{sentence}"):
        list(make_capture_of_video(video, tmp_path / "capture"))


@pytest.mark.parametrize(
    ("features", "agreeing", "brightness", "remedy"),
    [
        (900, 0.5, 120.0, "walk around the things that you film"),
        (900, 0.0, 20.0, "it is dark, 20 of 255 in the middle: film with more light"),
        (80, 0.0, 120.0, "80 features each, 150 are needed: film what has texture"),
        (900, 0.0, 120.0, "0% of its frames overlap with their neighbours: film more slowly"),
    ],
)
def test_what_is_to_be_filmed_otherwise_follows_from_what_was_found(
    features: float, agreeing: float, brightness: float, remedy: str
) -> None:
    none = SparseModel(np.zeros((0, 4, 4)), np.zeros((0, 3)))
    assert remedy in posing.Posing(none, features, agreeing).explain_failure(brightness)


def film_playground(path: Path, count: int = 12, arc: float = 0.6) -> torch.Tensor:
    """Film the playground from an arc around its middle [rad]; return the positions of the camera."""
    scene = load("playground")
    middle, size = (scene.box.lower + scene.box.upper) / 2, scene.box.size
    angles = torch.linspace(0, arc, count)
    around = 0.45 * size[0] * torch.stack([angles.cos(), angles.sin(), torch.zeros(count)], -1)
    up = torch.tensor([0.0, 0.0, 1.0]) * size
    poses = look_at(middle + around + 0.1 * up, (middle - 0.2 * up).expand(count, 3))
    camera, renderer = Camera.from_fov(480, 360, 70), MeshRenderer(scene, supersample=2)
    pictures = [renderer.render(camera, poses[index]).image.numpy() for index in range(count)]
    write_video(path, [np.ascontiguousarray(picture[..., ::-1]) for picture in pictures])
    return poses.position


@pytest.mark.slow
def test_a_video_around_a_place_is_posed_truly(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    video = tmp_path / "walk.avi"
    positions = film_playground(video)
    report = run_steps(make_capture_of_video(video, tmp_path / "capture"))
    assert report.frames >= 10 and report.frames_posed >= 0.8 * report.frames
    found = read_views(tmp_path / "capture").views
    truth = positions[[int(Path(view.name).stem) for view in found]].double().numpy()
    measured, true = pdist(np.stack([view.pose[:3, 3] for view in found])), pdist(truth)
    scale = measured @ true / (measured @ measured)
    assert np.abs(scale * measured - true).max() < 0.01 * true.max()
    assert found[0].lens.focal_u == pytest.approx(0.5 / np.tan(np.deg2rad(35)), rel=0.03)

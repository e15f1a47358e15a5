"""Sources of pictures: folders, lists, captures and videos."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from nerfnav.core.errors import InvalidInputError
from nerfnav.tracking import Frame
from nerfnav.tracking.sources.registry import SourceOptions, open_source


def paint(path: Path, level: int = 128) -> Path:
    """A picture of one grey level, red a little more."""
    path.parent.mkdir(parents=True, exist_ok=True)
    pixels = np.full((12, 16, 3), level, np.uint8)
    pixels[..., 2] += 10
    assert cv2.imwrite(str(path), pixels)
    return path


def frames(path: Path, fps: float | None = None) -> list[Frame]:
    return list(open_source(path, SourceOptions(fps)).frames())


def video(path: Path, count: int, fps: float = 20.0) -> Path:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), fps, (32, 24))
    for index in range(count):
        writer.write(np.full((24, 32, 3), 5 * index, np.uint8))
    writer.release()
    return path


def test_names_in_seconds_and_in_nanoseconds_are_times(tmp_path: Path) -> None:
    for name in ("12.5.png", "9.25.png"):
        paint(tmp_path / "s" / name)
    assert [frame.time for frame in frames(tmp_path / "s")] == [9.25, 12.5]
    paint(tmp_path / "ns" / "1403636579763555584.png")
    (frame,) = frames(tmp_path / "ns")
    assert frame.time == pytest.approx(1403636579.763555584) and frame.picture[0, 0].tolist() == [138, 128, 128]


@pytest.mark.parametrize(("names", "step"), [
    (("1606417097528152", "1606417097628152"), 0.1), (("1606417097528", "1606417097578"), 0.05),
    (("0000000050000000000", "0000000150000000000"), 100.0),
])  # fmt: skip
def test_names_since_1970_have_the_unit_of_their_magnitude(tmp_path: Path, names: tuple[str, ...], step: float) -> None:
    for name in names:
        paint(tmp_path / f"{name}.png")
    first, second = frames(tmp_path)
    assert second.time - first.time == pytest.approx(step, abs=1e-6)


def test_counted_pictures_need_a_rate(tmp_path: Path) -> None:
    for name in ("2.png", "10.png", "1.png"):
        paint(tmp_path / name)
    with pytest.raises(InvalidInputError, match="tells no time"):
        frames(tmp_path)
    counted = [(frame.time, frame.name) for frame in frames(tmp_path, 10)]
    assert counted == [(0, "1.png"), (0.1, "2.png"), (0.2, "10.png")]


def test_a_list_of_tum_is_read(tmp_path: Path) -> None:
    for index in range(3):
        paint(tmp_path / "rgb" / f"{index}.png", 40 * index)
    (tmp_path / "rgb.txt").write_text("# timestamp filename\n0.5 rgb/0.png\n0.6 rgb/1.png\n0.75 rgb/2.png\n")
    assert [frame.time for frame in frames(tmp_path)] == [0.5, 0.6, 0.75]
    assert open_source(tmp_path).count == 3
    (tmp_path / "rgb.txt").write_text("\ufeff1606417097528152\tRGB\\0.PNG\r\n1606417097628152,rgb/1.png\r\n")
    assert [frame.time for frame in frames(tmp_path)] == pytest.approx([1606417097.528152, 1606417097.628152], abs=1e-6)


@pytest.mark.parametrize(
    ("lines", "complaint"),
    [
        ("0.5 rgb/0.png\n0.4 rgb/1.png\n", "time must go on"),
        ("nan rgb/0.png\n", "line 1 of .* has 'nan' where a number should be"),
        ("rgb/0.png\n", "line 1"),
        ("# nothing\n", "names no pictures"),
        ("0.5 rgb/gone.png\n", "gone.png cannot be read"),
    ],
)
def test_a_list_that_cannot_be_used_is_refused(tmp_path: Path, lines: str, complaint: str) -> None:
    paint(tmp_path / "rgb" / "0.png")
    paint(tmp_path / "rgb" / "1.png")
    (tmp_path / "rgb.txt").write_text(lines)
    with pytest.raises(InvalidInputError, match=complaint):
        frames(tmp_path)


def test_a_capture_tells_times_and_its_camera(tmp_path: Path) -> None:
    told = [{"file_path": f"{index}.png", "time_s": 0.1 * index} for index in (1, 0)]
    head = {"w": 16, "h": 12, "fl_x": 14.0, "fl_y": 14.0, "cx": 8.0, "cy": 6.0}
    (tmp_path / "transforms.json").write_text(json.dumps({**head, "frames": told}))
    for index in (0, 1):
        paint(tmp_path / f"{index}.png")
    source = open_source(tmp_path)
    assert [frame.name for frame in source.frames()] == ["0.png", "1.png"]
    assert source.camera is not None and (source.camera.width, source.camera.fx) == (16, 14.0)
    told[0].pop("time_s")
    (tmp_path / "transforms.json").write_text(json.dumps({**head, "frames": told}))
    with pytest.raises(InvalidInputError, match="no time_s"):
        open_source(tmp_path)


def test_a_video_tells_when_each_frame_was_taken(tmp_path: Path) -> None:
    film = video(tmp_path / "film.mp4", 6)
    assert [frame.time for frame in frames(film)] == pytest.approx([index / 20 for index in range(6)], abs=1e-3)
    assert [frame.time for frame in frames(film, 5)] == pytest.approx([index / 5 for index in range(6)])
    assert open_source(film).count == 6


def test_a_video_that_ends_early_is_told_after_its_frames(tmp_path: Path) -> None:
    film = video(tmp_path / "film.avi", 40)
    content = film.read_bytes()
    film.write_bytes(content[: len(content) // 2])
    seen = []
    with pytest.raises(InvalidInputError, match=r"is cut off: it declares 40 frames|cannot be read as a video"):
        seen.extend(open_source(film).frames())


def test_what_is_no_source_is_told(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="there is no"):
        open_source(tmp_path / "gone")
    (tmp_path / "empty").mkdir()
    with pytest.raises(InvalidInputError, match="no pictures to track"):
        open_source(tmp_path / "empty")
    (tmp_path / "film.mp4").write_bytes(b"none")
    with pytest.raises(InvalidInputError, match="cannot be read as a video"):
        open_source(tmp_path / "film.mp4")
    with pytest.raises(InvalidInputError, match="above 0"):
        SourceOptions(float("nan"))


def test_names_of_a_capture_are_found_as_training_finds_them(tmp_path: Path) -> None:
    for index, name in enumerate(("images/0.png", "images/1.PNG", "images/._0.png")):
        paint(tmp_path / name, 40 * index)
    told = [{"file_path": "images\\0.png", "timestamp": 1_700_000_000_000}, {"file_path": "./images/1", "time_s": 2e9}]
    (tmp_path / "transforms.json").write_text(json.dumps({"frames": told}), encoding="utf-16")
    source = open_source(tmp_path)
    assert [frame.time for frame in source.frames()] == [1.7e9, 2e9] and source.camera is None


def test_the_camera_of_a_capture_is_refused_as_that_of_a_file_is(tmp_path: Path) -> None:
    paint(tmp_path / "0.png")
    head = {"w": 16, "h": 12, "fl_x": 12, "k5": 0.1}
    (tmp_path / "transforms.json").write_text(json.dumps({**head, "frames": [{"file_path": "0.png", "time_s": 0}]}))
    with pytest.raises(InvalidInputError, match="calibrate with those"):
        open_source(tmp_path)


def test_files_of_file_systems_are_no_pictures(tmp_path: Path) -> None:
    paint(tmp_path / "1.5.png")
    (tmp_path / "._1.5.png").write_bytes(b"\x00\x05\x16\x07")
    assert open_source(tmp_path).count == 1

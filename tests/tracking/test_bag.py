"""Recordings of ROS 2 as other programs write them."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from rosbags.rosbag2 import StoragePlugin

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import Camera
from nerfnav.tracking.sources.ros_bag import open_bag
from tests.tracking.recordings import (
    LENS,
    Recorded,
    Write,
    bag_folder,
    camera_info,
    compressed,
    image,
    imu,
    mcap_file,
    picture,
    static_frames,
)

IMAGE, COMPRESSED, INFO = (f"sensor_msgs/msg/{name}" for name in ("Image", "CompressedImage", "CameraInfo"))
Writing = Callable[[Path], AbstractContextManager[Write]]
WRITERS: dict[str, Writing] = {
    "mcap": mcap_file,
    "sqlite3": partial(bag_folder, storage=StoragePlugin.SQLITE3),
    "rosbag2-mcap": partial(bag_folder, storage=StoragePlugin.MCAP),
}


@pytest.fixture(params=WRITERS)
def recording(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Path]:
    path = tmp_path / ("flight.mcap" if request.param == "mcap" else "flight")
    with WRITERS[request.param](path) as write:
        Recorded().write(write)
    yield path


def written(path: Path, *messages: tuple[str, str, float, dict[str, Any]]) -> Path:
    """An MCAP of these messages."""
    with mcap_file(path) as write:
        for message in messages:
            write(*message)
    return path


def test_pictures_camera_and_inertial_measurements_are_read_with_their_times(recording: Path) -> None:
    source = open_bag(recording)
    frames = list(source.frames())
    assert source.count == len(frames) == 3
    for index, frame in enumerate(frames):
        assert frame.time == pytest.approx(10 + 0.1 * index, abs=1e-6) and frame.name == f"frame {index}"
        np.testing.assert_array_equal(frame.picture, picture(index))
    assert source.camera == Camera(32, 24, 30, 31, 16, 12, LENS)
    measured = source.inertial
    assert measured is not None and measured.times.dtype == torch.float64 and len(measured.times) == 30
    np.testing.assert_allclose(measured.times[:3], [10, 10.01, 10.02], atol=1e-6)
    np.testing.assert_allclose(measured.specific_forces[11], [1, 1, 9.81], rtol=1e-6)
    np.testing.assert_allclose(measured.body_rates[5], [0.1, 0.2, 0.3], rtol=1e-6)


@pytest.mark.parametrize(
    ("times", "rate", "complaint"),
    [((1.0, 1.1), np.nan, "of .*a.mcap has measurements that are no finite numbers"),
     ((1.0, 0.9), 0.1, "time must go on: measurement 1 of /imu")],
)  # fmt: skip
def test_inertial_measurements_that_cannot_be_used_are_told(
    tmp_path: Path, times: tuple[float, ...], rate: float, complaint: str
) -> None:
    messages = [("/imu", "sensor_msgs/msg/Imu", 1 + index, imu(time, (0, rate, 0), (0, 0, 9.81)))
                for index, time in enumerate(times)]  # fmt: skip
    source = open_bag(written(tmp_path / "a.mcap", ("/image", IMAGE, 1.0, image(1.0, picture())), *messages))
    with pytest.raises(InvalidInputError, match=complaint):
        assert source.inertial


def test_how_the_camera_is_mounted_on_the_unit_is_read_from_the_static_frames(tmp_path: Path) -> None:
    frames = static_frames(
        ("base", "imu", (1.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)), ("base", "mast", (0.0, 0.0, 2.0), (0.0, 0.0, 0.0, 1.0)),
        ("mast", "camera", (0.0, 3.0, 0.0), (0.0, 0.0, 0.5**0.5, 0.5**0.5)),
    )  # fmt: skip
    messages = [
        ("/image", IMAGE, 1.0, image(1.0, picture())),
        ("/imu", "sensor_msgs/msg/Imu", 1.0, imu(1.0, (0, 0, 0), (0, 0, 9.81))),
    ]
    tf = "/tf_static", "tf2_msgs/msg/TFMessage", 0.5, frames
    told = open_bag(written(tmp_path / "a.mcap", *messages, tf)).inertial
    assert told is not None and told.mount is not None
    np.testing.assert_allclose(told.mount.position, [-1, 3, 2], atol=1e-6)
    np.testing.assert_allclose(told.mount.rotation, [[0, 1, 0], [1, 0, 0], [0, 0, -1]], atol=1e-6)
    told = open_bag(written(tmp_path / "b.mcap", *messages)).inertial
    assert told is not None and told.mount is None


@pytest.mark.parametrize("encoding", ["rgb8", "bgr8", "rgba8", "bgra8"])
def test_all_orders_of_colours_are_read_with_padded_rows(tmp_path: Path, encoding: str) -> None:
    pixels = picture()
    stored = pixels[..., ::-1] if encoding.startswith("bgr") else pixels
    if encoding.endswith("a8"):
        stored = np.concatenate([stored, np.full_like(stored[..., :1], 7)], -1)
    message = image(1.0, np.ascontiguousarray(stored), encoding, padding=5)
    (frame,) = open_bag(written(tmp_path / "a.mcap", ("/image", IMAGE, 1.0, message))).frames()
    np.testing.assert_array_equal(frame.picture, pixels)


@pytest.mark.parametrize(("kind", "off"), [("png", 0), ("jpg", 60)])
def test_compressed_pictures_are_read(tmp_path: Path, kind: str, off: int) -> None:
    smooth = np.repeat(np.linspace(0, 255, 32).astype(np.uint8)[None, :, None], 24, 0) * np.array([1, 0, 0], np.uint8)
    path = written(tmp_path / "a.mcap", ("/image/compressed", COMPRESSED, 1.0, compressed(1.0, smooth, kind)))
    (frame,) = open_bag(path).frames()
    assert np.abs(frame.picture.numpy().astype(int) - smooth).max() <= off
    assert frame.picture[:, -1, 0].float().mean() > 200 > 60 > frame.picture[:, -1, 2].float().mean(), "red stays red"


def test_a_rectified_topic_has_the_projection_and_no_distortion(tmp_path: Path) -> None:
    messages = (("/cam/camera_info", INFO, 1.0, camera_info()), ("/cam/image_rect", IMAGE, 1.0, image(1.0, picture())))
    assert open_bag(written(tmp_path / "a.mcap", *messages)).camera == Camera(32, 24, 28, 28.5, 15, 11)


def region(x: int, y: int, width: int, height: int) -> dict[str, Any]:
    return {"x_offset": x, "y_offset": y, "width": width, "height": height, "do_rectify": False}


@pytest.mark.parametrize("topic", ["image", "image_rect"])
def test_a_region_moves_the_matrix_and_binning_divides_it(tmp_path: Path, topic: str) -> None:
    info = camera_info(width=128, height=96, roi=region(40, 20, 64, 48), binning_x=2, binning_y=2, d=())
    messages = (("/camera_info", INFO, 1.0, info), (f"/{topic}", IMAGE, 1.0, image(1.0, picture())))
    camera = open_bag(written(tmp_path / "a.mcap", *messages)).camera
    focal = (14, 14.25, -12.5, -4.5) if topic == "image_rect" else (15, 15.5, -12, -4)
    assert camera == Camera(32, 24, *focal)


@pytest.mark.parametrize(("change", "said"), [
    ({"width": 2**32 - 1}, "width is 4294967295, a number at most 65536"), ({"height": 0}, "height is 0, a number"),
    ({"roi": region(2**32 - 1, 0, 2**32 - 1, 24)}, "roi is 4294967295 x 24 pixels from 4294967295, 0"),
    ({"binning_x": 2**32 - 1}, "binning by 4294967295 x 1 leaves no pixel"), ({"d": (np.nan,)}, r"d\[0\] is NaN"),
])  # fmt: skip
def test_numbers_that_do_not_fit_are_one_sentence(tmp_path: Path, change: dict[str, Any], said: str) -> None:
    messages = (("/camera_info", INFO, 1.0, camera_info(**change)), ("/image", IMAGE, 1.0, image(1.0, picture())))
    with pytest.raises(InvalidInputError, match=f"holds no camera that is supported: .*{said}") as told:
        open_bag(written(tmp_path / "a.mcap", *messages))
    assert "\n" not in str(told.value)


def test_a_fisheye_is_one_and_a_camera_at_twice_the_size_is_the_same(tmp_path: Path) -> None:
    info = camera_info(d=(0.1, 0.01, 0.0, 0.0), distortion_model="equidistant", width=64, height=48)
    messages = (("/camera_info", INFO, 1.0, info), ("/image", IMAGE, 1.0, image(1.0, picture())))
    camera = open_bag(written(tmp_path / "a.mcap", *messages)).camera
    assert camera == Camera(32, 24, 15, 15.5, 8, 6, (0.1, 0.01, 0, 0), fisheye=True)


@pytest.mark.parametrize("info", [None, camera_info(k=(0.0,) * 9)])
def test_without_a_calibration_there_is_no_camera(tmp_path: Path, info: dict[str, Any] | None) -> None:
    with mcap_file(tmp_path / "a.mcap") as write:
        Recorded(info=info, inertial=False).write(write)
    source = open_bag(tmp_path / "a.mcap")
    assert source.camera is None and source.inertial is None


def test_of_several_topics_the_one_that_is_asked_for_is_read_with_its_own_camera(tmp_path: Path) -> None:
    path = written(
        tmp_path / "a.mcap",
        ("/left/image", IMAGE, 1.0, image(1.0, picture(1))), ("/right/image", IMAGE, 1.0, image(1.0, picture(2))),
        ("/left/camera_info", INFO, 1.0, camera_info()),
        ("/right/camera_info", INFO, 1.0, camera_info(d=(), distortion_model="")),
    )  # fmt: skip
    with pytest.raises(InvalidInputError, match="several topics: choose one with --topic of /left/image, /right/image"):
        open_bag(path)
    with pytest.raises(InvalidInputError, match="no pictures in /up/image; it has some in /left/image, /right/image"):
        open_bag(path, "/up/image")
    source = open_bag(path, "/right/image")
    assert source.camera == Camera(32, 24, 30, 31, 16, 12)
    assert (next(source.frames()).picture.numpy() == picture(2)).all()


BAD: dict[str, tuple[str, str, dict[str, Any]]] = {
    "its encoding 'bayer_rggb8' is not known here; known are rgb8, bgr8": (
        "/image", IMAGE, image(1.0, picture(), "bayer_rggb8")),
    r"it is grey \(mono8\), and fields are compared in colour": (
        "/image", IMAGE, image(1.0, picture()[..., 0], "mono8")),
    "it is grey or deeper than 8 bits": ("/image", COMPRESSED, compressed(1.0, picture()[..., 0])),
    "no whole JPEG or PNG": (
        "/image", COMPRESSED, compressed(1.0, picture()) | {"data": np.arange(40, dtype=np.uint8)}),
    "it says 32 x 48 pixels of rgb8 in rows of 96 bytes, and has 2304 bytes": (
        "/image", IMAGE, image(1.0, picture()) | {"height": 48}),
    "has no pictures: nothing in it is a sensor_msgs/Image": ("/info", INFO, camera_info()),
}  # fmt: skip


@pytest.mark.parametrize("complaint", BAD)
def test_what_cannot_be_used_is_told_in_one_sentence(tmp_path: Path, complaint: str) -> None:
    topic, kind, message = BAD[complaint]
    with pytest.raises(InvalidInputError, match=complaint) as told:
        open_bag(written(tmp_path / "a.mcap", (topic, kind, 1.0, message)))
    assert "a.mcap" in str(told.value) and "\n" not in str(told.value)


def test_time_that_runs_backwards_is_refused(tmp_path: Path) -> None:
    messages = [("/image", IMAGE, 1.0 + index, image(time, picture())) for index, time in enumerate((5.0, 6.0, 5.5))]
    frames = open_bag(written(tmp_path / "a.mcap", *messages)).frames()
    assert (next(frames).time, next(frames).time) == (5.0, 6.0)
    with pytest.raises(InvalidInputError, match=r"frame 2 .* was taken at 5\.500000 s, and the one before at 6\.0"):
        next(frames)


def test_messages_without_a_stamp_have_the_time_of_the_recording(tmp_path: Path) -> None:
    messages = [("/image", IMAGE, time, image(0.0, picture())) for time in (3.0, 4.0)]
    assert [frame.time for frame in open_bag(written(tmp_path / "a.mcap", *messages)).frames()] == [3.0, 4.0]


@pytest.mark.parametrize("share", [0.0, 0.01, 0.5, 0.98])
def test_a_file_that_is_cut_off_is_refused(recording: Path, share: float) -> None:
    file = recording if recording.is_file() else next(f for f in recording.iterdir() if f.suffix in (".db3", ".mcap"))
    file.write_bytes(file.read_bytes()[: round(share * file.stat().st_size)])
    with pytest.raises(InvalidInputError, match="is no whole recording of ROS 2, or cut off") as told:
        for _ in open_bag(recording).frames():
            pass
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("entry", "wrong"),
    [("name: /", "name: 7 # "), ("type: sensor_msgs/msg/Imu", "type: [2]"), ("message_count: ", "message_count: x")],
)
def test_entries_of_a_wrong_type_are_refused(tmp_path: Path, entry: str, wrong: str) -> None:
    with WRITERS["sqlite3"](tmp_path / "flight") as write:
        Recorded().write(write)
    metadata = tmp_path / "flight" / "metadata.yaml"
    text = metadata.read_text()
    topics = text.index("topics_with_message_count")
    assert entry in text[topics:]
    metadata.write_text(text[:topics] + text[topics:].replace(entry, wrong))
    with pytest.raises(InvalidInputError, match=r"in its metadata\.yaml a topic has"):
        open_bag(tmp_path / "flight")


def test_what_is_no_recording_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(b"\x89PNG" * 100)
    for path in (tmp_path / "a.mcap", tmp_path, tmp_path / "missing.mcap"):
        with pytest.raises(InvalidInputError, match="is no whole recording of ROS 2"):
            open_bag(path)

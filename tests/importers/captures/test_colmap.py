"""COLMAP's models, text and binary."""

import re
import shutil
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from nerfnav.importers.captures.formats import is_capture, read_views
from nerfnav.importers.captures.views import CaptureError
from tests.importers.captures.synthetic import CAMERA, matrices, ring, write_colmap, write_points


@pytest.mark.parametrize("binary", [False, True])
def test_poses_and_intrinsics_come_back_as_they_were_written(tmp_path: Path, binary: bool) -> None:
    found = read_views(write_colmap(tmp_path, binary))
    assert found.kind == "COLMAP" and all(view.exists for view in found.views)
    np.testing.assert_allclose(np.stack([view.pose for view in found.views]), matrices(ring()), atol=1e-6)
    assert found.views[0].lens.camera(CAMERA.width, CAMERA.height) == CAMERA


@pytest.mark.parametrize("binary", [False, True])
@pytest.mark.parametrize(
    ("number", "name", "numbers", "focal", "distortion"),
    [
        (0, "SIMPLE_PINHOLE", (40, 24, 18), (40, 40), ()),
        (1, "PINHOLE", (40, 41, 24, 18), (40, 41), ()),
        (2, "SIMPLE_RADIAL", (40, 24, 18, 0.1), (40, 40), (0.1,)),
        (3, "RADIAL", (40, 24, 18, 0.1, 0.2), (40, 40), (0.1, 0.2)),
        (4, "OPENCV", (40, 41, 24, 18, 0.1, 0.2, 0.3, 0.4), (40, 41), (0.1, 0.2, 0.3, 0.4)),
        (6, "FULL_OPENCV", (40, 41, 24, 18, *range(1, 9)), (40, 41), tuple(range(1, 9))),
    ],
)
def test_every_model_has_its_numbers_in_its_own_order(
    tmp_path: Path, binary: bool, number: int, name: str, numbers: tuple[float, ...], focal: tuple, distortion: tuple
) -> None:
    lens = read_views(write_colmap(tmp_path, binary, (number, name, numbers))).views[0].lens
    camera = lens.camera(CAMERA.width, CAMERA.height)
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == pytest.approx((*focal, 24, 18))
    assert lens.distortion[: len(distortion)] == distortion
    assert not any(lens.distortion[len(distortion) :])


@pytest.mark.parametrize("binary", [False, True])
def test_names_may_have_spaces(tmp_path: Path, binary: bool) -> None:
    names = [f"my picture {index}.png" for index in range(8)]
    assert [view.name for view in read_views(write_colmap(tmp_path, binary, names=names)).views] == names


@pytest.mark.parametrize("binary", [False, True])
def test_an_unknown_model_is_refused_with_those_that_are_known(tmp_path: Path, binary: bool) -> None:
    prism = (10, "THIN_PRISM_FISHEYE", (40.0, 41.0, 24.0, 18.0, *8 * (0.0,)))
    with pytest.raises(CaptureError, match="camera model THIN_PRISM_FISHEYE; known are: SIMPLE_PINHOLE, PINHOLE"):
        read_views(write_colmap(tmp_path, binary, prism))


@pytest.mark.parametrize("binary", [False, True])
@pytest.mark.parametrize(
    ("number", "name", "numbers", "known"),
    [
        (5, "OPENCV_FISHEYE", (40, 41, 24, 18, 0.1, 0.2, 0.3, 0.4), (0.1, 0.2, 0.3, 0.4)),
        (8, "SIMPLE_RADIAL_FISHEYE", (40, 24, 18, 0.1), (0.1, 0.0, 0.0, 0.0)),
        (9, "RADIAL_FISHEYE", (40, 24, 18, 0.1, 0.2), (0.1, 0.2, 0.0, 0.0)),
        (5, "OPENCV_FISHEYE", (40, 41, 24, 18, 0, 0, 0, 0), (0.0, 0.0, 0.0, 0.0)),
    ],
)
def test_a_fisheye_is_known_as_one_also_without_distortion(
    tmp_path: Path, binary: bool, number: int, name: str, numbers: tuple[float, ...], known: tuple[float, ...]
) -> None:
    lens = read_views(write_colmap(tmp_path, binary, (number, name, numbers))).views[0].lens
    camera = lens.camera(CAMERA.width, CAMERA.height)
    assert camera.fisheye and camera.distortion == pytest.approx(known)


@pytest.mark.parametrize("binary", [False, True])
def test_a_focal_length_of_zero_is_refused(tmp_path: Path, binary: bool) -> None:
    with pytest.raises(CaptureError, match=r"camera 7 in .*: focal lengths are above 0 pixels"):
        read_views(write_colmap(tmp_path, binary, (0, "SIMPLE_PINHOLE", (0.0, 24.0, 18.0))))


@pytest.mark.parametrize("file", ["cameras.bin", "images.bin"])
@pytest.mark.parametrize("share", [0.0, 0.1, 0.6, 0.99])
def test_a_binary_model_that_is_cut_off_is_refused(tmp_path: Path, file: str, share: float) -> None:
    path = write_colmap(tmp_path, binary=True) / "sparse" / "0" / file
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    with pytest.raises(CaptureError, match=f"{file} is cut off, or no COLMAP model"):
        read_views(tmp_path)


@pytest.mark.parametrize(
    ("file", "content", "message"),
    [
        ("images.txt", "1 2 3\n", "describes no image"),
        ("images.txt", "# nothing\n", "has no images"),
        ("images.txt", "1 1 0 0 0 0 0 0 9 a.png\n\n", "camera 9, which .* does not describe"),
        ("images.txt", "1 0 0 0 0 0 0 0 7 a.png\n\n", "quaternion is zero or has NaN"),
        ("images.txt", "1 nan 0 0 0 0 0 0 7 a.png\n\n", "quaternion is zero or has NaN"),
        ("cameras.txt", "7 PINHOLE 48\n", "describes no camera"),
        ("cameras.txt", "7 PINHOLE 48 36 40 40\n", "has 2 numbers, but the model PINHOLE has 4"),
        ("cameras.txt", "7 PINHOLE 48 36 nan 40 24 18\n", "finite numbers"),
    ],
)
def test_lines_that_make_no_sense_are_refused(tmp_path: Path, file: str, content: str, message: str) -> None:
    (write_colmap(tmp_path, binary=False) / "sparse" / "0" / file).write_text(content)
    with pytest.raises(CaptureError, match=message):
        read_views(tmp_path)


def test_a_binary_file_with_the_name_of_a_text_is_refused(tmp_path: Path) -> None:
    (write_colmap(tmp_path, binary=False) / "sparse" / "0" / "images.txt").write_bytes(b"\x01\xff\xfe\x00")
    with pytest.raises(CaptureError, match=r"as text: .*; a binary model ends in \.bin"):
        read_views(tmp_path)


def test_photographs_may_lie_beside_the_model(tmp_path: Path) -> None:
    write_colmap(tmp_path, binary=True)
    for path in (tmp_path / "images").iterdir():
        path.rename(tmp_path / path.name)
    (tmp_path / "images").rmdir()
    assert all(view.exists for view in read_views(tmp_path).views)


@pytest.mark.parametrize("file", ["images.bin", "points3D.bin"])
@pytest.mark.parametrize("count", [2**64 - 1, 2**61, 10**6])
def test_a_count_that_the_file_cannot_hold_is_one_sentence(tmp_path: Path, file: str, count: int) -> None:
    path = write_points(write_colmap(tmp_path, True), True, [((0, 0, 0), 0.5, [1, 2, 3])]) / "sparse" / "0" / file
    data = path.read_bytes()
    tail = 8 + 3 * 8 if file == "points3D.bin" else 8 + 7 * 24  # the last track, or the features of the last image
    path.write_bytes(data[: len(data) - tail] + count.to_bytes(8, "little") + data[len(data) - tail + 8 :])
    with pytest.raises(CaptureError, match=f"{file} is cut off, or no COLMAP model"):
        read_views(tmp_path)


@pytest.mark.parametrize("binary", [False, True])
def test_a_camera_that_no_image_uses_may_have_any_model(tmp_path: Path, binary: bool) -> None:
    folder = write_colmap(tmp_path, binary)
    path = folder / "sparse" / "0" / ("cameras.bin" if binary else "cameras.txt")
    if binary:
        data = path.read_bytes()
        more = struct.pack("<IiQQ5d", 9, 7, 48, 36, *5 * (1.0,)) + struct.pack("<IiQQ12d", 10, 10, 48, 36, *12 * (1.0,))
        path.write_bytes(struct.pack("<Q", 3) + more + data[8:])
    else:
        path.write_text(f"9 FOV 48 36 1 1 1 1 1\n10 NEW 48 36 1\n{path.read_text()}")
    assert len(read_views(folder).views) == 8


@pytest.mark.parametrize("place", ["input", "images_4", "sparse/0/images", "rgb"])
def test_photographs_are_found_beside_the_model_and_around_it(tmp_path: Path, place: str) -> None:
    folder = write_colmap(tmp_path, binary=False)
    (folder / place).parent.mkdir(parents=True, exist_ok=True)
    (folder / "images").rename(folder / place)
    assert all(view.exists for view in read_views(folder).views)


@pytest.mark.parametrize("given", ["sparse/0", "sparse"])
def test_the_folder_of_the_model_or_of_models_is_a_capture_too(tmp_path: Path, given: str) -> None:
    assert all(view.exists for view in read_views(write_colmap(tmp_path, binary=True) / given).views)


def test_photographs_that_are_nowhere_are_named_with_the_places(tmp_path: Path) -> None:
    folder = write_colmap(tmp_path, binary=False)
    (folder / "images").rename(folder / "elsewhere")
    with pytest.raises(CaptureError, match=r"8 photographs, but none .*: 000\.png is the first, .* images/, input/"):
        read_views(folder)


@pytest.mark.parametrize("parent", ["sparse", "colmap/sparse", "distorted/sparse"])
def test_of_several_models_the_one_with_the_most_images_counts(tmp_path: Path, parent: str) -> None:
    folder = write_colmap(tmp_path, binary=False)
    (folder / parent).parent.mkdir(exist_ok=True)
    (folder / "sparse").rename(folder / parent)
    (folder / parent / "0").rename(folder / parent / "10")
    small = folder / parent / "2"
    shutil.copytree(folder / parent / "10", small)
    kept = (small / "images.txt").read_text().splitlines(True)
    (small / "images.txt").write_text("".join(kept[: 1 + 2 * 5]))
    (folder / parent / "0").mkdir()
    (folder / parent / "0" / "cameras.txt").write_text("")  # begun, without images
    found = read_views(folder)
    assert len(found.views) == 8
    assert found.guesses == (f"model: {parent}/10, which has 8 pictures ({parent}/2 has 5)",)


@pytest.mark.parametrize("suffix", [".bin", ".txt"])
def test_a_model_without_images_is_called_that(tmp_path: Path, suffix: str) -> None:
    folder = write_colmap(tmp_path, suffix == ".bin")
    (folder / "sparse" / "0" / f"images{suffix}").unlink()
    assert is_capture(folder)
    with pytest.raises(CaptureError, match=r"0 is a COLMAP model without images\.bin or images\.txt"):
        read_views(folder)


def _without_features(text: str) -> str:
    return "\n".join(line for line in text.splitlines() if line.endswith(".png"))


@pytest.mark.parametrize("change", [
    lambda text: f"\ufeff{text}", lambda text: text.replace("\n", "\r\n"), lambda text: text.replace(" ", "\t"),
    lambda text: text.replace("\n", "\n# a comment\n"), _without_features, lambda text: text + "\n\n\n",
])  # fmt: skip
def test_text_is_read_in_every_dialect(tmp_path: Path, change: Callable[[str], str]) -> None:
    folder = write_points(write_colmap(tmp_path, False), False, [((0, 0, 0), 0.5, [1, 2, 3])])
    for name in ("cameras", "images", "points3D"):
        path = folder / "sparse" / "0" / f"{name}.txt"
        if change is not _without_features or name == "images":
            path.write_bytes(change(path.read_text()).encode())
    found = read_views(folder)
    np.testing.assert_allclose(np.stack([view.pose for view in found.views]), matrices(ring()), atol=1e-6)
    assert found.tracks is not None and len(found.tracks.points) == 1


def test_names_of_windows_and_other_capitals_are_found(tmp_path: Path) -> None:
    folder = write_colmap(tmp_path, binary=False)
    path = folder / "sparse" / "0" / "images.txt"
    path.write_text(re.sub(r"(\d+)\.png", r"Left\\\1.PNG", path.read_text()))
    (folder / "images").rename(folder / "left")
    (folder / "images").mkdir()
    (folder / "left").rename(folder / "images" / "left")
    assert all(view.exists for view in read_views(folder).views)


@pytest.mark.parametrize("focal", ["1e-30", "1e30", "-1", "nan"])
def test_a_focal_length_of_no_lens_is_told_with_its_camera(tmp_path: Path, focal: str) -> None:
    write_colmap(tmp_path, binary=False)
    cameras = tmp_path / "sparse" / "0" / "cameras.txt"
    number = next(line for line in cameras.read_text().splitlines() if not line.startswith("#")).split()[0]
    cameras.write_text(f"{number} PINHOLE 48 36 40 {focal} 24 18\n")
    with pytest.raises(CaptureError, match=f"camera {number} in .*cameras.txt") as error:
        read_views(tmp_path)
    assert len(str(error.value)) < 400

"""COLMAP's models, text and binary."""

from pathlib import Path

import numpy as np
import pytest

from nerfnav.importers.captures.formats import read_views
from nerfnav.importers.captures.views import CaptureError
from tests.importers.captures.synthetic import CAMERA, matrices, ring, write_colmap


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
    with pytest.raises(CaptureError, match="focal length must be above 0, not 0"):
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
    with pytest.raises(CaptureError, match="is not text"):
        read_views(tmp_path)


def test_photographs_may_lie_beside_the_model(tmp_path: Path) -> None:
    write_colmap(tmp_path, binary=True)
    for path in (tmp_path / "images").iterdir():
        path.rename(tmp_path / path.name)
    (tmp_path / "images").rmdir()
    assert all(view.exists for view in read_views(tmp_path).views)

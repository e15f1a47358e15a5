"""transforms.json and Blender's splits: what they say, and what is refused."""

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from nerfnav.importers.captures.formats import read_views
from nerfnav.importers.captures.views import CaptureError
from tests.importers.captures.synthetic import CAMERA, changed, matrices, ring, transforms, write_transforms


def test_poses_and_intrinsics_come_back_as_they_were_written(tmp_path: Path) -> None:
    found = read_views(write_transforms(tmp_path))
    assert found.kind == "transforms.json"
    poses = np.stack([view.pose for view in found.views])
    np.testing.assert_allclose(poses, matrices(ring()), atol=1e-6)
    assert found.views[0].lens.camera(CAMERA.width, CAMERA.height) == CAMERA
    assert all(view.exists for view in found.views)


def test_the_file_itself_is_a_capture_as_its_folder_is(tmp_path: Path) -> None:
    write_transforms(tmp_path)
    assert len(read_views(tmp_path / "transforms.json").views) == len(read_views(tmp_path).views)


def test_intrinsics_of_a_frame_hold_for_it_alone(tmp_path: Path) -> None:
    folder = changed(write_transforms(tmp_path), lambda said: said["frames"][2].update(fl_x=50.0, k1=0.1))
    lenses = [view.lens for view in read_views(folder).views]
    assert lenses[2].focal_u == pytest.approx(50 / CAMERA.width) and lenses[2].distortion[0] == 0.1
    assert lenses[1].focal_u == pytest.approx(CAMERA.fx / CAMERA.width) and not lenses[1].distortion


def test_names_are_found_without_their_ending(tmp_path: Path) -> None:
    def shorten(said: dict[str, Any]) -> None:
        for frame in said["frames"]:
            frame["file_path"] = "./" + frame["file_path"].removesuffix(".png")

    assert all(view.exists for view in read_views(changed(write_transforms(tmp_path), shorten)).views)


def test_a_transform_that_was_applied_is_undone_scale_and_all(tmp_path: Path) -> None:
    turn = np.array([[0.0, 0.0, 0.5, 1.0], [0.5, 0.0, 0.0, 2.0], [0.0, 0.5, 0.0, 3.0]])  # axes swapped, half as large
    applied = np.vstack([turn, [0, 0, 0, 1]])

    def apply(said: dict[str, Any]) -> None:
        said["applied_transform"] = turn.tolist()
        for frame in said["frames"]:
            moved = applied @ np.array(frame["transform_matrix"])
            moved[:3, :3] /= 0.5
            frame["transform_matrix"] = moved.tolist()

    found = read_views(changed(write_transforms(tmp_path), apply))
    np.testing.assert_allclose(np.stack([view.pose for view in found.views]), matrices(ring()), atol=1e-6)


def test_an_opening_angle_is_enough_of_a_lens(tmp_path: Path) -> None:
    folder = write_transforms(tmp_path, w=None, h=None, fl_x=None, fl_y=None, cx=None, cy=None, camera_angle_x=1.0)
    camera = read_views(folder).views[0].lens.camera(80, 60)
    assert (camera.fx, camera.fy) == pytest.approx((40 / math.tan(0.5),) * 2)
    assert (camera.cx, camera.cy) == (40, 30)


def test_blenders_splits_keep_what_is_not_for_training(tmp_path: Path) -> None:
    poses = ring(6)
    names = [f"{index:03}.png" for index in range(6)]
    for split, part in (("train", slice(0, 4)), ("val", slice(4, 5)), ("test", slice(5, 6))):
        said = transforms(names[part], poses[part], camera_angle_x=0.7)
        (tmp_path / f"transforms_{split}.json").write_text(json.dumps(said))
    found = read_views(tmp_path)
    assert found.kind == "Blender"
    assert [view.test for view in found.views] == [False] * 4 + [True] * 2
    (tmp_path / "transforms_train.json").unlink()
    assert not any(view.test for view in read_views(tmp_path).views)


@pytest.mark.parametrize("content", [b"", b'{"frames": [', b"\x89PNG\r\n\x1a\n\xff\xfe", b"a letter", b"[" * 100_000])
def test_files_that_are_not_json_are_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "transforms.json").write_bytes(content)
    with pytest.raises(CaptureError, match=r"not readable as (JSON|text)"):
        read_views(tmp_path)


@pytest.mark.parametrize("content", ["[]", "{}", '{"frames": []}', '{"frames": 3}', '{"frames": [1]}'])
def test_json_that_is_no_capture_is_refused(tmp_path: Path, content: str) -> None:
    (tmp_path / "transforms.json").write_text(content)
    with pytest.raises(CaptureError, match=r"the file is a list|frames(\[0\])? is|no list of frames"):
        read_views(tmp_path)


def frame(index: int, **entries: Any) -> Callable[[dict[str, Any]], None]:
    return lambda said: said["frames"][index].update(entries)


NAN = [[math.nan, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
SINGULAR = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1]]
SKEWED = [[1, 0.5, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
MIRRORED = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (frame(3, transform_matrix=NAN), r"frames\[3\]\.transform_matrix\[0\]\[0\] is NaN, a finite number"),
        (frame(3, transform_matrix=SINGULAR), "singular or skewed"),
        (frame(3, transform_matrix=np.zeros((4, 4)).tolist()), "singular or skewed"),
        (frame(3, transform_matrix=SKEWED), "singular or skewed"),
        (frame(3, transform_matrix=MIRRORED), "mirrored"),
        (frame(3, transform_matrix=[[1, 2], [3]]), r"is a list of 2, a list with a length"),
        (frame(3, transform_matrix="north"), r"transform_matrix is \"north\", a list is needed"),
        (frame(3, transform_matrix=[[10**400] * 4] * 4), "too large a number, a finite"),
        (frame(3, file_path=None), r"frames\[3\]\.file_path is null, a text"),
        (frame(3, camera_model="OMNI"), "camera model OMNI; known are: OPENCV"),
        (lambda said: (said.pop("fl_x"), said.update(is_fisheye=True, camera_angle_x=2)), "is a fisheye's, and has no"),
        (lambda said: said.update(fl_x=0), "fl_x is 0, a number above 0 is needed"),
        (lambda said: said.update(fl_y=-3), "fl_y is -3, a number above 0 is needed"),
        (lambda said: said.update(cx="left"), "cx is \"left\", a number is needed"),
        (lambda said: said.update(k1=math.nan), "k1 is NaN, a finite number is needed"),
        (lambda said: said.update(fl_x=10**400), "fl_x is infinite, or too large a number, a finite number"),
        (lambda said: said.update(w=0), "w is 0, a number at least 1 is needed"),
        (lambda said: (said.pop("fl_x"), said.pop("fl_y")), "no intrinsics"),
        (lambda said: (said.pop("fl_x"), said.update(camera_angle_x=4)), "camera_angle_x is 4, a number at most 3.141"),
        (lambda said: said.update(applied_transform=[[1, 2]]), "applied_transform"),
        (lambda said: said.update(applied_transform=np.zeros((3, 4)).tolist()), "applied_transform"),
    ],
)
def test_numbers_that_make_no_sense_are_refused_by_name(
    tmp_path: Path, change: Callable[[dict[str, Any]], object], message: str
) -> None:
    with pytest.raises(CaptureError, match=message):
        read_views(changed(write_transforms(tmp_path), change))


def test_a_rotation_that_was_only_rounded_is_made_exact(tmp_path: Path) -> None:
    def round_it(said: dict[str, Any]) -> None:
        for entry in said["frames"]:
            entry["transform_matrix"] = np.round(entry["transform_matrix"], 3).tolist()

    for view in read_views(changed(write_transforms(tmp_path), round_it)).views:
        np.testing.assert_allclose(view.pose[:3, :3] @ view.pose[:3, :3].T, np.eye(3), atol=1e-12)


def test_nerfstudios_lists_say_what_judges(tmp_path: Path) -> None:
    named = [f"./images\\{index:03}" for index in range(8)]
    folder = write_transforms(tmp_path, train_filenames=named[:5], val_filenames=named[5:6], test_filenames=named[6:7])
    assert [view.test for view in read_views(folder).views] == 5 * [False] + 3 * [True]
    changed(folder, lambda said: (said.pop("train_filenames"), said.pop("val_filenames")))
    assert [view.test for view in read_views(folder).views] == [index == 6 for index in range(8)]


def test_an_applied_scale_is_undone_and_depth_keeps_its_unit(tmp_path: Path) -> None:
    def apply(said: dict[str, Any]) -> None:
        said["applied_scale"] = 0.25
        for index, entry in enumerate(said["frames"]):
            moved = np.array(entry["transform_matrix"])
            moved[:3, 3] *= 0.25
            entry.update(transform_matrix=moved.tolist(), depth_file_path=f"{index}.npy")

    found = read_views(changed(write_transforms(tmp_path), apply))
    np.testing.assert_allclose(np.stack([view.pose for view in found.views]), matrices(ring()), atol=1e-6)
    assert all(view.depth is not None and view.depth.unit == 0.001 for view in found.views)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_byte_order_marks_are_read(tmp_path: Path, encoding: str) -> None:
    path = write_transforms(tmp_path) / "transforms.json"
    path.write_text(path.read_text(), encoding=encoding)
    assert len(read_views(tmp_path).views) == 8

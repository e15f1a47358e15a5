"""transforms.json: lenses, depth, splits and times in the dialects of nerfstudio, instant-ngp and Blender."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from nerfnav.core.errors import InvalidInputError
from nerfnav.formats.camera_file import read_camera
from nerfnav.formats.transforms import (
    FileLens,
    common_lens,
    depth_unit,
    lens_of,
    read_transforms,
    time_of,
    undo_applied,
)
from nerfnav.geometry import Camera

POSE = np.eye(4).tolist()
SIZE = {"w": 96, "h": 72}


def written(folder: Path, *frames: dict[str, Any], **head: Any) -> Path:
    path = folder / "transforms.json"
    named = [{"file_path": f"{index}.png", "transform_matrix": POSE, **frame} for index, frame in enumerate(frames)]
    path.write_text(json.dumps({**head, "frames": named}))
    return path


def lens(folder: Path, **head: Any) -> FileLens:
    record, _ = read_transforms(written(folder, {}, **head))
    return lens_of(record, record.frames[0], "0.png")


@pytest.mark.parametrize(
    ("head", "focal", "center"),
    [
        ({**SIZE, "fl_x": 80}, (80, 80), (48, 36)),
        ({**SIZE, "fl_x": 80, "fl_y": 81, "cx": 30, "cy": 50}, (80, 81), (30, 50)),
        ({**SIZE, "fl_y": 81}, (81, 81), (48, 36)),
        ({**SIZE, "camera_angle_x": 2 * math.atan(0.6), "cx": 30, "cy": 50}, (80, 80), (30, 50)),
        ({**SIZE, "camera_angle_x": 2 * math.atan(0.6), "camera_angle_y": 2 * math.atan(0.4)}, (80, 90), (48, 36)),
        ({**SIZE, "x_fov": math.degrees(2 * math.atan(0.6)), "cy": 0}, (80, 80), (48, 0)),
        ({**SIZE, "fl_x": 80, "camera_angle_x": 1.0}, (80, 80), (48, 36)),
    ],
)
def test_a_lens_is_given_in_pixels_or_by_its_angle(
    tmp_path: Path, head: dict[str, Any], focal: tuple[float, float], center: tuple[float, float]
) -> None:
    found = lens(tmp_path, **head)
    assert (found.fx, found.fx if found.fy is None else found.fy) == pytest.approx(focal)
    assert (found.cx, found.cy) == pytest.approx(center)


def test_an_angle_alone_is_a_lens_of_pictures_of_any_size(tmp_path: Path) -> None:
    found = lens(tmp_path, camera_angle_x=2 * math.atan(0.5))
    assert found.size is None and found.fx == pytest.approx(1) and found.fy is None
    with pytest.raises(InvalidInputError, match="no w and h"):
        lens(tmp_path, camera_angle_x=1.0, cx=30)


@pytest.mark.parametrize(
    "head", [{"is_fisheye": True}, {"camera_model": "OPENCV_FISHEYE"}, {"camera_model": "RADIAL_FISHEYE"}]
)
def test_a_fisheye_is_one_in_captures_and_in_cameras(tmp_path: Path, head: dict[str, Any]) -> None:
    path = written(tmp_path, **SIZE, fl_x=80, k1=0.1, k2=0.01, **head)
    assert common_lens(read_transforms(path)[0], path) == FileLens((96, 72), 80, 80, 48, 36, (0.1, 0.01, 0, 0), True)
    assert read_camera(path) == Camera(96, 72, 80, 80, 48, 36, (0.1, 0.01, 0.0, 0.0), fisheye=True)


@pytest.mark.parametrize("key", ["k4", "k5", "k6"])
def test_a_camera_of_more_coefficients_is_refused(tmp_path: Path, key: str) -> None:
    with pytest.raises(InvalidInputError, match="calibrate with those"):
        read_camera(written(tmp_path, **SIZE, fl_x=80, camera_model="FULL_OPENCV", **{key: 0.01}))


@pytest.mark.parametrize("key", ["ftheta_p0", "latlong", "equirectangular"])
def test_lenses_that_are_not_known_are_refused(tmp_path: Path, key: str) -> None:
    with pytest.raises(InvalidInputError, match=f"a lens by {key}, which is not known"):
        lens(tmp_path, **SIZE, fl_x=80, **{key: 1.0})


def test_frames_of_one_lens_are_a_camera_and_of_several_are_none(tmp_path: Path) -> None:
    own = {**SIZE, "fl_x": 80, "k1": 0.1}
    assert read_camera(written(tmp_path, own, own)).distortion == (0.1, 0, 0, 0, 0)
    with pytest.raises(InvalidInputError, match="frames of different lenses"):
        read_camera(written(tmp_path, own, {**own, "fl_x": 81}))


@pytest.mark.parametrize(
    ("head", "unit"),
    [
        ({"integer_depth_scale": 0.0002}, 0.0002),
        ({"integer_depth_scale": 0.0002, "enable_depth_loading": True}, 0.0002),
        ({"depth_unit_scale_factor": 0.01}, 0.01),
        ({"integer_depth_scale": 0.0002, "enable_depth_loading": False}, None),
        ({"integer_depth_scale": -1}, None),
        ({}, None),
    ],
)
def test_depth_path_has_a_unit_or_is_ignored_with_the_reason(
    tmp_path: Path, head: dict[str, Any], unit: float | None
) -> None:
    record, keys = read_transforms(written(tmp_path, {"depth_path": "0.png"}, **head))
    assert depth_unit(record) == unit
    assert ("frames[].depth_path" in keys.ignored) == (unit is None)


def test_what_was_applied_is_undone_scale_after_transform(tmp_path: Path) -> None:
    applied = np.array([[0.0, 0.0, 1.0, 1.0], [1.0, 0.0, 0.0, 2.0], [0.0, 1.0, 0.0, 3.0]])
    record, _ = read_transforms(written(tmp_path, applied_transform=applied.tolist(), applied_scale=0.25))
    point = np.array([3.0, -2.0, 5.0])
    undo = undo_applied(record, tmp_path)
    assert undo is not None
    np.testing.assert_allclose(undo @ [*(0.25 * (applied[:, :3] @ point + applied[:, 3])), 1], [*point, 1])


@pytest.mark.parametrize(
    ("entry", "seconds"),
    [
        ({"time_s": 1.5}, 1.5),
        ({"timestamp": 12.5}, 12.5),
        ({"timestamp": 1_700_000_000.25}, 1_700_000_000.25),
        ({"timestamp": 1_700_000_000_250}, 1_700_000_000.25),
        ({"timestamp": 1_700_000_000_250_000}, 1_700_000_000.25),
        ({"timestamp": 1_700_000_000_250_000_000}, 1_700_000_000.25),
        ({}, None),
    ],
)
def test_times_are_in_seconds(tmp_path: Path, entry: dict[str, Any], seconds: float | None) -> None:
    record, _ = read_transforms(written(tmp_path, entry))
    assert time_of(record.frames[0]) == (None if seconds is None else pytest.approx(seconds, abs=1e-6))


def test_keys_of_the_dialects_are_known(tmp_path: Path) -> None:
    path = written(tmp_path, {"sharpness": 3.0, "foo": 1}, **SIZE, fl_x=80, aabb_scale=16, scale=0.3, bar="x")
    _, keys = read_transforms(path)
    assert keys.ignored.keys() == {"aabb_scale", "scale", "frames[].sharpness"} and all(keys.ignored.values())
    assert set(keys.unknown) == {"bar", "frames[].foo"}

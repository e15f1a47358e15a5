"""Calibrations of ROS, OpenCV, Kalibr and EuRoC in their dialects, and what is no calibration."""

import json
from pathlib import Path

import pytest

from nerfnav.core.errors import InvalidInputError
from nerfnav.formats import parse_camera, read_camera
from nerfnav.geometry import Camera

K = "[500.0, 0.0, 320.0, 0.0, 501.0, 240.0, 0.0, 0.0, 1.0]"
D = (0.1, -0.2, 0.001, 0.002, 0.0)
PLAIN = Camera(640, 480, 500.0, 501.0, 320.0, 240.0)
BROWN = Camera(640, 480, 500.0, 501.0, 320.0, 240.0, D)
ECHO = f"height: 480\nwidth: 640\ndistortion_model: plumb_bob\nD: {list(D)}\nK: {K}\nbinning_x: 0\nbinning_y: 0\n"
CHAIN = """cam0:
  camera_model: pinhole
  distortion_coeffs: [0.1, -0.2, 0.001, 0.002]
  distortion_model: radtan
  intrinsics: [500.0, 501.0, 320.0, 240.0]
  resolution: [640, 480]
"""
XML = f"""<?xml version="1.0"?>
<opencv_storage>
<image_Width>640</image_Width> <image_Height>480</image_Height>
<Camera_Matrix type_id="opencv-matrix"><rows>3</rows><cols>3</cols><dt>d</dt>
  <data>500. 0. 320. 0. 501. 240. 0. 0. 1.</data></Camera_Matrix>
<Distortion_Coefficients type_id="opencv-matrix"><rows>5</rows><cols>1</cols><dt>d</dt>
  <data>{" ".join(map(str, D))}</data></Distortion_Coefficients>
</opencv_storage>
"""


def read(folder: Path, text: str, name: str = "c.yaml", camera: str = "") -> Camera:
    (folder / name).write_bytes(text.encode())
    return read_camera(folder / f"{name}{camera}")


def refused(folder: Path, text: str, name: str = "c.yaml", camera: str = "") -> str:
    with pytest.raises(InvalidInputError) as caught:
        read(folder, text, name, camera)
    assert "\n" not in str(caught.value) and name in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("text", [
    ECHO, f"{ECHO}---\n", f"header:\n  seq: 1\n{ECHO}---\nheader:\n  seq: 2\n{ECHO}---\n",
    ECHO.replace("D:", "d:").replace("K:", "k:"), f"\ufeff{ECHO}", ECHO.replace("\n", "\r\n"),
    CHAIN.replace("0.002]", "0.002, 0.0]"), XML,
    CHAIN.replace("cam0:\n", "").replace("  ", "").replace("0.002]", "0.002, 0]"),
    json.dumps({"image_width": 640, "image_height": 480, "cameraMatrix": [[500, 0, 320], [0, 501, 240], [0, 0, 1]],
                "distCoeffs": [D]}),
])  # fmt: skip
def test_every_dialect_gives_the_same_camera(tmp_path: Path, text: str) -> None:
    assert read(tmp_path, text) == BROWN


@pytest.mark.parametrize("matrix", [K, "[[500, 0, 320], [0, 501, 240], [0, 0, 1]]", f"{{data: {K}}}",
                                    f"!!opencv-matrix {{rows: 3, cols: 3, dt: d, data: {K}}}"])  # fmt: skip
def test_a_matrix_is_a_list_or_has_its_numbers_as_data(tmp_path: Path, matrix: str) -> None:
    text = f"%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\ncamera_matrix: {matrix}\n"
    assert read(tmp_path, text) == PLAIN


@pytest.mark.parametrize("line", [
    "camera_model: equidistant", "distortion_model: fisheye", "distortion_model: Kannala-Brandt", "fisheye_model: 1",
    "distortion_model: equidistant\ncamera_model: pinhole", "is_fisheye: true",
])  # fmt: skip
def test_each_name_of_a_fisheye_is_one(tmp_path: Path, line: str) -> None:
    text = f"image_width: 640\nimage_height: 480\nK: {K}\ndistortion_coefficients: [0.1, -0.02, 1e-3]\n{line}\n"
    assert read(tmp_path, text) == Camera(640, 480, 500.0, 501.0, 320.0, 240.0, (0.1, -0.02, 0.001, 0.0), True)


def test_one_of_several_cameras_is_named_behind_a_colon(tmp_path: Path) -> None:
    second = CHAIN.replace("cam0", "cam1").replace("500.0", "400.0")
    assert read(tmp_path, CHAIN + second, camera=":cam1").fx == 400
    assert "has 2 cameras: choose one of cam0, cam1, as in c.yaml:cam0" in refused(tmp_path, CHAIN + second)
    assert "has no camera cam2; it has cam0, cam1" in refused(tmp_path, CHAIN + second, camera=":cam2")


@pytest.mark.parametrize(("change", "camera"), [
    ({"roi": {"x_offset": 20, "y_offset": 40, "width": 600, "height": 400}},
     Camera(600, 400, 500.0, 501.0, 300.0, 200.0)),
    ({"binning_x": 2, "binning_y": 2}, Camera(320, 240, 250.0, 250.5, 160.0, 120.0)),
    ({"binning_x": 2, "roi": {"x_offset": 20, "y_offset": 0, "width": 600, "height": 480}},
     Camera(300, 480, 250.0, 501.0, 150.0, 240.0)),
    ({"binning_x": 1, "roi": {"x_offset": 0, "y_offset": 0, "width": 0, "height": 0}}, PLAIN),
])  # fmt: skip
def test_a_region_and_binning_move_and_divide_the_matrix(change: dict[str, object], camera: Camera) -> None:
    entries = {"width": 640, "height": 480, "K": [500, 0, 320, 0, 501, 240, 0, 0, 1]}
    assert parse_camera({**entries, **change}, "it") == camera


@pytest.mark.parametrize(("text", "said"), [
    (ECHO.replace("640", ".inf"), "a number at most 65536 is needed"),
    (ECHO.replace("640", "9" * 400), "width is "),
    (ECHO.replace("640", "-640"), "width is -640, a number at least 1"),
    (ECHO.replace("640", "wide"), 'width is "wide", a number'),
    (ECHO.replace("500.0", ".nan"), "K[0] is NaN, a finite number"),
    (ECHO.replace("500.0, 0.0, 320.0", "500.0, 0.0"), "K has 9 numbers, not 8"),
    (ECHO.replace(K, "[500, 0, 0, 0, 501, 0, 320, 240, 1]"), "K is not [fx, 0, cx, 0, fy, cy, 0, 0, 1]"),
    (ECHO.replace(K, "'...'"), 'K is "...", a list'),
    (ECHO.replace("K:", "M:"), "camera_matrix is missing"),
    (ECHO.replace("plumb_bob", "[1]"), "distortion_model is a list of 1, a text"),
    (ECHO.replace("D: [", "D: [1, 2, 3, "), "a lens of more than k1, k2, p1, p2 and k3"),
    (ECHO + "roi: {x_offset: 600, y_offset: 0, width: 100, height: 480}\n", "roi is 100 x 480 pixels from 600, 0 on"),
    (ECHO + "roi: {x_offset: -1}\n", "roi.x_offset is -1, a number at least 0"),
    (ECHO.replace("binning_x: 0", "binning_x: 1000"), "binning by 1000 x 1 leaves no pixel"),
    (f"{ECHO}---\n{ECHO.replace('640', '320')}", "has 2 cameras"),
    (ECHO + "camera_model: equidistant\n", "the lens is said to be plumb_bob and equidistant"),
    (CHAIN.replace("pinhole", "omni").replace("[500.0", "[1.0, 500.0"), "camera model omni has 5 numbers"),
    (CHAIN.replace("pinhole", "ds"), "the lens model 'ds' is not known here"),
    (CHAIN.replace("radtan", "fov"), "the lens model 'fov' is not known here"),
    (CHAIN.replace("480]", "480, 1]"), "resolution is a list of 3"),
    ("- 1\n- 2\n", "holds no names with values"), ("", "holds no names with values"),
    ("a: [", "is not readable as YAML"),
    ("!!python/object/apply:os.getcwd []", "is not readable as YAML"), (XML[:200], "is not readable as XML"),
    (XML.replace("<opencv", '<!DOCTYPE a [<!ENTITY b "c">]><opencv', 1), "XML that defines entities"),
])  # fmt: skip
def test_what_is_no_calibration_is_one_sentence_with_the_key(tmp_path: Path, text: str, said: str) -> None:
    assert said in refused(tmp_path, text)


def test_of_colmaps_cameras_only_those_count_that_images_use(tmp_path: Path) -> None:
    cameras = "\ufeff1 PINHOLE 640 480 500 501 320 240\r\n2\tFOV 640 480 1 1 1 1 1\r\n3 PINHOLE 64 48 9 9 3 2\r\n"
    assert "has 3 cameras: choose one of 1, 2, 3" in refused(tmp_path, cameras, "cameras.txt")
    assert read(tmp_path, cameras, "cameras.txt", ":1") == PLAIN
    assert "has the camera model FOV" in refused(tmp_path, cameras, "cameras.txt", ":2")
    (tmp_path / "images.txt").write_text("1 1 0 0 0 0 0 0 1 a.png\n\n")
    assert read(tmp_path, cameras, "cameras.txt") == PLAIN

"""Calibrations of other programs, against what OpenCV makes of the same numbers."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.formats import format_camera, read_camera
from nerfnav.geometry import Camera

MATRIX = np.array([[320.0, 0, 310], [0, 322.0, 245], [0, 0, 1]])
BROWN, FISHEYE = (-0.2, 0.05, 0.001, -0.002, 0.01), (0.03, -0.01, 0.004, -0.001)
PIXELS = torch.tensor([[0, 0], [639, 0], [310, 245], [100, 400], [639, 479]])


def ros(model: str, coefficients: tuple[float, ...]) -> str:
    return f"""image_width: 640
image_height: 480
camera_name: front
camera_matrix: {{rows: 3, cols: 3, data: {MATRIX.ravel().tolist()}}}
distortion_model: {model}
distortion_coefficients: {{rows: 1, cols: {len(coefficients)}, data: {list(coefficients)}}}
"""


def opencv(coefficients: tuple[float, ...], folder: Path, fisheye: bool) -> str:
    path = str(folder / "stored.yaml")
    storage = cv2.FileStorage(path, cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", 640)
    storage.write("image_height", 480)
    storage.write("camera_matrix", MATRIX)
    storage.write("distortion_coefficients", np.array([coefficients]))
    storage.write("fisheye_model", int(fisheye))
    storage.release()
    return Path(path).read_text()


def transforms(model: str, names: str, coefficients: tuple[float, ...]) -> str:
    lens = dict(zip(names.split(), coefficients, strict=True))
    numbers = {"w": 640, "h": 480, "fl_x": 320.0, "fl_y": 322.0, "cx": 310.0, "cy": 245.0}
    return json.dumps({"camera_model": model, **numbers, **lens, "frames": []})


def directions_by_opencv(coefficients: tuple[float, ...], fisheye: bool) -> torch.Tensor:
    pixels = (PIXELS.double().numpy() + 0.5)[:, None]
    enough = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 300, 1e-10)
    undo = cv2.fisheye.undistortPoints if fisheye else cv2.undistortPoints
    x, y = undo(pixels, MATRIX, np.array(coefficients), criteria=enough)[:, 0].T
    rays = np.stack([x, -y, -np.ones_like(x)], -1)
    return torch.from_numpy(rays / np.linalg.norm(rays, axis=-1, keepdims=True)).float()


@pytest.mark.parametrize(
    ("name", "fisheye"),
    [("ros.yaml", False), ("ros.yaml", True), ("cv.yml", False), ("cv.yml", True), ("a.json", False), ("a.json", True)],
)
def test_a_calibration_shows_each_pixel_where_opencv_does(tmp_path: Path, name: str, fisheye: bool) -> None:
    coefficients = FISHEYE if fisheye else BROWN
    text = {
        "ros.yaml": lambda: ros("equidistant" if fisheye else "plumb_bob", coefficients),
        "cv.yml": lambda: opencv(coefficients, tmp_path, fisheye),
        "a.json": lambda: transforms(
            "OPENCV_FISHEYE" if fisheye else "OPENCV", "k1 k2 k3 k4" if fisheye else "k1 k2 p1 p2 k3", coefficients
        ),
    }[name]()
    (tmp_path / name).write_text(text)
    camera = read_camera(tmp_path / name)
    assert (camera.width, camera.height, camera.fisheye) == (640, 480, fisheye)
    expected = directions_by_opencv(coefficients, fisheye)
    torch.testing.assert_close(camera.directions(PIXELS), expected, atol=2e-5, rtol=0)


def test_a_fisheye_sees_beside_itself() -> None:
    camera = Camera(400, 400, 100, 100, 200, 200, (0.0, 0.0, 0.0, 0.0), fisheye=True)
    aside = camera.directions(torch.tensor([[399, 200]]))[0]
    angle = torch.tensor(1.995)
    expected = torch.stack([angle.sin(), torch.tensor(-0.0023), -angle.cos()])
    torch.testing.assert_close(aside, expected, atol=2e-3, rtol=0)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("plumb_bob", "omnidirectional"), "the lens model 'omnidirectional' is not known"),
        (("image_width: 640\n", ""), "width and height are missing"),
        (("image_width: 640", "image_width: 640.5"), "image_width is 640.5, a number without a fraction"),
        (("320.0", ".nan"), "camera_matrix[0] is NaN, a finite number"),
        (("320.0", "-320.0"), "focal lengths"),
        (("rows: 3, cols: 3, data: [320.0, ", "rows: 3, cols: 3, data: ["), "9 numbers"),
        (("camera_matrix", "matrix"), "camera_matrix is missing"),
        (("image_width", "image_width: [4]\nwas"), "image_width is a list of 1, a number"),
        (("-0.2,", ".inf,"), "finite"),
    ],
)
def test_what_is_no_camera_is_told_in_one_sentence(tmp_path: Path, change: tuple[str, str], said: str) -> None:
    text = ros("plumb_bob", BROWN)
    assert change[0] in text
    (tmp_path / "a.yaml").write_text(text.replace(*change))
    with pytest.raises(InvalidInputError, match="is no calibration") as caught:
        read_camera(tmp_path / "a.yaml")
    assert said in str(caught.value)


def test_a_lens_of_more_numbers_than_are_known_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(ros("rational_polynomial", (*BROWN, 0.1, 0.1, 0.1)))
    with pytest.raises(InvalidInputError, match="calibrate with those"):
        read_camera(tmp_path / "a.yaml")


def test_a_fisheye_that_folds_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="cannot be undone"):
        Camera(400, 400, 100, 100, 200, 200, (-0.5, 0.0, 0.0, 0.0), fisheye=True).directions(torch.tensor([[0, 0]]))


@pytest.mark.parametrize("fisheye", [False, True])
def test_colmaps_cameras_are_a_calibration(tmp_path: Path, fisheye: bool) -> None:
    coefficients = FISHEYE if fisheye else BROWN[:4]
    numbers = " ".join(map(str, (320.0, 322.0, 318.0, 242.0, *coefficients)))
    model = "OPENCV_FISHEYE" if fisheye else "OPENCV"
    (tmp_path / "cameras.txt").write_text(f"# a comment\n3 {model} 640 480 {numbers}\n")
    camera = read_camera(tmp_path / "cameras.txt")
    assert camera == Camera(640, 480, 320, 322, 318, 242, tuple(coefficients), fisheye)
    assert Camera.of_numbers(camera.numbers) == camera


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("1 PINHOLE 64 48 50 50 32 24\n2 PINHOLE 64 48 51 50 32 24\n", "has 2 cameras"),
        ("", "has 0 cameras"),
        ("1 OMNI 64 48 50\n", "known are: SIMPLE_PINHOLE"),
        ("1 PINHOLE 64 48 50 50 32\n", "has 3 numbers, but the model PINHOLE has 4"),
        ("1 PINHOLE 64 48 50 -50 32 24\n", "focal lengths are above 0"),
        ("1 PINHOLE 64 48 50 1e-30 32 24\n", "cameras.txt .* focal lengths are above 0"),
        (f"1 {5000 * 'A'} 64 48 50 50 32 24\n", "camera model A{40}\\.\\.\\.; known"),
        ("1 FULL_OPENCV 64 48 50 50 32 24 0 0 0 0 0 1 0 0\n", "calibrate with those"),
    ],
)
def test_colmaps_cameras_that_cannot_be_used_are_told_in_one_sentence(tmp_path: Path, content: str, said: str) -> None:
    (tmp_path / "cameras.txt").write_text(content)
    with pytest.raises(InvalidInputError, match=said):
        read_camera(tmp_path / "cameras.txt")


@pytest.mark.parametrize(
    "camera",
    [
        Camera(640, 480, 525.0, 520.0, 321.0, 240.5),
        Camera(640, 480, 525.0, 520.0, 321.0, 240.5, (0.1, -0.2, 1e-3, -2e-5, 0.05)),
        Camera(640, 480, 300.0, 300.0, 320.0, 240.0, (0.1, -0.02, 1e-3, 0.0), fisheye=True),
    ],
)
def test_a_camera_that_is_written_is_read_again(tmp_path: Path, camera: Camera) -> None:
    (tmp_path / "camera.json").write_text(format_camera(camera))
    assert read_camera(tmp_path / "camera.json") == camera

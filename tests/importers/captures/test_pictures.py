"""Photographs as pixels: lenses straightened, all through one camera, colours unharmed."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from nerfnav.geometry.camera import Camera
from nerfnav.importers.captures.pictures import (
    Picture,
    common_camera,
    over_white,
    read_pixels,
    resample_picture,
    shrink_picture,
    undistortion,
)
from nerfnav.importers.captures.views import CaptureError, Lens
from tests.importers.captures.synthetic import CAMERA, matrices, picture, ring

BARREL = (-0.12, 0.03, 0.004, -0.006, 0.01, 0.0, 0.0, 0.0)
PINCUSHION = (0.15, 0.02, -0.003, 0.002, 0.0, 0.0, 0.0, 0.0)
POSE = matrices(ring())[1]


@pytest.mark.parametrize("distortion", [BARREL, PINCUSHION])
def test_a_distorted_picture_becomes_what_a_pinhole_sees_to_a_tenth_of_a_pixel(distortion: tuple[float, ...]) -> None:
    shot = Picture(picture(CAMERA, POSE, distortion), CAMERA, distortion)
    camera = common_camera([shot])
    error = resample_picture(shot, camera).astype(float) - picture(camera, POSE)
    # a shift of a whole pixel changes colours by 2.5 x 120 / 40 = 7.5 levels; interpolation rounds by about 1
    assert np.abs(error).max() < 4 and np.abs(error).mean() < 0.75


FISHEYE = Camera(200, 160, 62.0, 62.5, 101.0, 78.0, (-0.01, 0.001, 0.0005, 0.0), fisheye=True)
"""Its picture is some 180 degrees wide."""


def test_a_fisheyes_picture_becomes_what_a_pinhole_of_120_degrees_sees() -> None:
    shot = Picture(picture(FISHEYE, POSE), FISHEYE, ())
    camera = common_camera([shot])
    assert not camera.fisheye and not camera.distortion
    widest = 2 * math.degrees(math.atan(camera.width / camera.fx / 2))
    assert 118 < widest <= 120
    error = resample_picture(shot, camera).astype(float) - picture(camera, POSE)
    assert np.abs(error).max() < 6 and np.abs(error).mean() < 1


def test_a_fisheye_with_a_narrow_picture_shows_no_empty_corner() -> None:
    narrow = Camera(60, 40, 62.0, 62.0, 25.0, 20.0, (0.0, 0.0, 0.0, 0.0), fisheye=True)
    shot = Picture(np.full((40, 60, 3), 255, np.uint8), narrow, ())
    camera = common_camera([shot])
    u, v = undistortion(narrow, (), camera)
    assert u.min() >= -0.51 and u.max() <= 59.51 and v.min() >= -0.51 and v.max() <= 39.51
    assert camera.width > 45 and camera.height > 30


def test_a_fisheye_that_looks_beside_its_picture_is_refused() -> None:
    beside = Camera(60, 40, 62.0, 62.0, -25.0, 20.0, (0.0, 0.0, 0.0, 0.0), fisheye=True)
    with pytest.raises(CaptureError, match="nothing around its principal point"):
        common_camera([Picture(np.zeros((40, 60, 3), np.uint8), beside, ())])


def test_pictures_of_one_pinhole_keep_every_pixel() -> None:
    shot = Picture(picture(CAMERA, POSE), CAMERA, ())
    camera = common_camera([shot, shot])
    assert camera == CAMERA
    assert resample_picture(shot, camera) is shot.pixels


def test_pictures_of_different_lenses_come_to_one_camera_that_all_of_them_fill() -> None:
    others = [CAMERA, Camera(60, 80, 70.0, 70.0, 30.0, 41.0), replace(CAMERA, fx=33.0, cx=25.0)]
    shots = [Picture(picture(camera, POSE), camera, ()) for camera in others]
    camera = common_camera(shots)
    for shot in shots:
        error = resample_picture(shot, camera).astype(float) - picture(camera, POSE)
        # half a pixel of the border has no neighbour to interpolate with
        assert np.abs(error[1:-1, 1:-1]).mean() < 1.0


def test_lenses_without_a_common_view_are_refused() -> None:
    left, right = replace(CAMERA, cx=-100.0), replace(CAMERA, cx=100.0)
    with pytest.raises(CaptureError, match="view in common"):
        common_camera([Picture(picture(camera, POSE), camera, ()) for camera in (left, right)])


def test_a_distortion_that_folds_the_picture_is_refused() -> None:
    with pytest.raises(CaptureError, match="cannot be undone"):
        common_camera([Picture(np.zeros((36, 48, 3), np.uint8), CAMERA, (-5.0, 0, 0, 0, 0, 0, 0, 0))])


def test_smaller_pictures_are_means_and_keep_their_view() -> None:
    lens = Lens.measured("a test", (48, 36), (40.0, 41.0), (23.0, 18.5))
    small = shrink_picture(picture(CAMERA, POSE), lens, 4)
    assert (small.camera.width, small.camera.height, small.camera.fx, small.camera.cy) == (12, 9, 10.0, 18.5 / 4)
    assert np.abs(small.pixels.astype(float) - picture(small.camera, POSE)).mean() < 2


def test_pictures_that_were_stored_smaller_than_measured_fit_their_lens() -> None:
    lens = Lens.measured("a test", (96, 72), (80.0, 82.0), (46.0, 37.0))
    assert shrink_picture(picture(CAMERA, POSE), lens, 1).camera == CAMERA


def test_a_picture_of_another_shape_than_its_lens_is_refused() -> None:
    with pytest.raises(CaptureError, match="was it cropped or turned"):
        lens = Lens.measured("a test", (48, 36), (40.0, 40.0), (24.0, 18.0))
        shrink_picture(np.zeros((48, 36, 3), np.uint8), lens, 1)


def test_what_is_clear_is_white() -> None:
    pixels = np.array([[[10, 20, 30, 0], [10, 20, 30, 255], [0, 0, 0, 51]]], np.uint8)
    assert over_white(pixels).tolist() == [[[255, 255, 255], [10, 20, 30], [204, 204, 204]]]


@pytest.mark.parametrize(
    ("mode", "channels"), [("RGB", 3), ("RGBA", 4), ("L", 3), ("LA", 4), ("P", 3), ("CMYK", 3), ("1", 3)]
)
def test_pictures_of_every_mode_become_colours(tmp_path: Path, mode: str, channels: int) -> None:
    path = tmp_path / ("a.jpg" if mode == "CMYK" else "a.png")
    Image.new("RGB", (5, 4), (255, 255, 255)).convert(mode).save(path)
    pixels = read_pixels(path)
    assert pixels is not None and pixels.shape == (4, 5, channels) and pixels.dtype == np.uint8
    assert pixels[..., :3].min() > 250


def test_deep_grey_pictures_become_colours(tmp_path: Path) -> None:
    Image.fromarray(np.full((4, 5), 65535, np.uint16)).save(tmp_path / "a.png")
    pixels = read_pixels(tmp_path / "a.png")
    assert pixels is not None and pixels.shape == (4, 5, 3) and pixels.min() == 255


def test_a_picture_whose_stored_pixels_fit_its_lens_is_not_turned_by_its_exif(tmp_path: Path) -> None:
    turned = Image.Exif()
    turned[0x0112] = 6
    Image.new("RGB", (5, 4)).save(tmp_path / "a.jpg", exif=turned)
    pixels = read_pixels(tmp_path / "a.jpg", Lens.measured("a test", (5, 4), (4.0, 4.0), (2.5, 2.0)))
    assert pixels is not None and pixels.shape == (4, 5, 3)


@pytest.mark.parametrize("name", ["a.png", "a.jpg"])
@pytest.mark.parametrize("share", [0.0, 0.3, 0.8])
def test_a_file_that_is_no_whole_picture_is_none(tmp_path: Path, name: str, share: float) -> None:
    noise = np.random.default_rng(0).integers(0, 255, (40, 40, 3), np.uint8)
    Image.fromarray(noise).save(tmp_path / name)
    content = (tmp_path / name).read_bytes()
    (tmp_path / name).write_bytes(content[: int(share * len(content))])
    assert read_pixels(tmp_path / name) is None
    (tmp_path / name).write_text("a letter")
    assert read_pixels(tmp_path / name) is None

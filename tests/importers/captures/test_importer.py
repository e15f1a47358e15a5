"""Whole captures: read, placed in the world, parted, and reported about."""

import json
import math
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.steps import run_steps
from nerfnav.geometry.camera import Camera, look_at
from nerfnav.importers.captures import importer
from nerfnav.importers.captures.config import ImportConfig, ImportedCapture
from nerfnav.importers.captures.importer import import_capture
from nerfnav.importers.captures.views import CaptureError
from nerfnav.importers.core.placement import MeasuredDistance, Placement, Vector
from tests.importers.captures.synthetic import (
    CAMERA,
    changed,
    matrices,
    picture,
    ring,
    transforms,
    write_colmap,
    write_pictures,
    write_transforms,
)


def imported(source: Path, config: ImportConfig | None = None) -> ImportedCapture:
    return run_steps(import_capture(source, config or ImportConfig()))


def test_steps_end_at_all_of_the_import(tmp_path: Path) -> None:
    *_, last = import_capture(write_transforms(tmp_path), ImportConfig())
    assert last.fraction == 1


def test_every_format_gives_the_same_photographs_and_poses(tmp_path: Path) -> None:
    captures = [
        imported(write_transforms(tmp_path / "json")),
        imported(write_colmap(tmp_path / "text", binary=False)),
        imported(write_colmap(tmp_path / "binary", binary=True)),
    ]
    kept = [index for index in range(8) if index != 4]
    for found in captures:
        assert found.learned.camera == CAMERA
        assert len(found.learned) == 7 and len(found.held_out) == 1
        poses = torch.from_numpy(matrices(ring())).float()
        torch.testing.assert_close(found.learned.poses.position, poses[kept, :3, 3], atol=1e-6, rtol=0)
        torch.testing.assert_close(found.learned.poses.rotation, poses[kept, :3, :3], atol=1e-6, rtol=0)
        assert np.array_equal(found.held_out.images[0].numpy(), picture(CAMERA, matrices(ring())[4]))
        assert not found.bounded
        mean = found.learned.images.float().mean((0, 1, 2)) / 255
        torch.testing.assert_close(found.background, mean)


def test_what_was_found_and_guessed_is_reported(tmp_path: Path) -> None:
    report = imported(write_transforms(tmp_path)).report
    assert (report.kind, report.images_named, report.images_used, report.images_skipped) == ("transforms.json", 8, 8, 0)
    assert (report.image_size, report.downscale, report.images_held_out) == ((48, 36), 1, 1)
    assert (report.scale, report.up) == (1.0, (0.0, 0.0, 1.0))
    assert [guess.split(":")[0] for guess in report.guesses] == ["up", "scale", "box"]
    assert report.placed == (1, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0)  # scale, rotation, translation


def test_what_was_said_is_not_guessed(tmp_path: Path) -> None:
    placement = Placement(up=(0, 0, 2), scale=1.0, box=((-1, -1, -1), (1, 1, 2)))
    found = imported(write_transforms(tmp_path), ImportConfig(placement, downscale=1))
    assert found.report.guesses == ()
    assert found.report.box == ((-1, -1, -1), (1, 1, 2))
    assert found.box.upper.tolist() == [1, 1, 2]


def test_metres_come_from_a_scale_or_from_two_picked_points(tmp_path: Path) -> None:
    write_transforms(tmp_path)
    plain = imported(tmp_path)
    for placement in (Placement(scale=0.25), Placement(picked=MeasuredDistance((0, 0, 0), (0, 3, 4), 1.25))):
        scaled = imported(tmp_path, ImportConfig(placement))
        assert scaled.report.scale == 0.25
        torch.testing.assert_close(scaled.learned.poses.position, 0.25 * plain.learned.poses.position)
        torch.testing.assert_close(scaled.learned.poses.rotation, plain.learned.poses.rotation)
        torch.testing.assert_close(scaled.box.size, 0.25 * plain.box.size)


def test_up_turns_cameras_and_places_alike(tmp_path: Path) -> None:
    found = imported(write_transforms(tmp_path), ImportConfig(Placement(up=(0, 1, 0))))
    x, y, z = found.learned.poses[0].position.tolist()
    original = matrices(ring())[0]
    assert (x, y, z) == pytest.approx((original[0, 3], -original[2, 3], original[1, 3]), abs=1e-6)
    forward = -found.learned.poses[0].rotation[:, 2]
    toward = torch.nn.functional.normalize(-found.learned.poses[0].position, dim=0)
    torch.testing.assert_close(forward, toward)


def test_captures_in_the_coordinates_of_a_map_are_moved_to_where_numbers_are_exact(tmp_path: Path) -> None:
    def move(said: dict) -> None:
        for frame in said["frames"]:
            frame["transform_matrix"][0][3] += 500_000
            frame["transform_matrix"][1][3] += 5_000_000

    near = imported(write_transforms(tmp_path))
    far = imported(changed(tmp_path, move))
    torch.testing.assert_close(
        near.learned.poses.position - near.learned.poses.position[0],
        far.learned.poses.position - far.learned.poses.position[0],
        atol=1e-6,
        rtol=0,
    )
    assert any(guess.startswith("origin: moved to 500000 5000000 0 m") for guess in far.report.guesses)
    boxed = Placement(box=((499_999, 4_999_999, -1), (500_001, 5_000_001, 1)))
    assert imported(tmp_path, ImportConfig(boxed)).box.size.tolist() == [2, 2, 2]
    assert float(imported(tmp_path, ImportConfig(boxed)).box.center.norm()) < 3


def test_large_photographs_are_made_smaller_which_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importer, "LONGEST", 20)
    report = imported(write_transforms(tmp_path)).report
    assert (report.downscale, report.image_size) == (3, (16, 12))
    assert any(guess.startswith("downscale") for guess in report.guesses)
    assert imported(tmp_path, ImportConfig(downscale=2)).report.image_size == (24, 18)


def test_cut_out_pictures_stand_before_white_in_a_box_of_their_own(tmp_path: Path) -> None:
    poses, names = ring(8, radius=2.0, height=1.0), []
    (tmp_path / "train").mkdir()
    for index, pose in enumerate(matrices(poses)):
        u, v = np.meshgrid(np.arange(48) + 0.5, np.arange(36) + 0.5)
        distance = np.linalg.norm(pose[:3, 3])
        radius = 0.4 * CAMERA.fx / distance
        disc = np.hypot(u - CAMERA.cx, v - CAMERA.cy) < radius
        pixels = np.dstack([np.full((36, 48, 3), 90, np.uint8), disc.astype(np.uint8) * 255])
        Image.fromarray(pixels).save(tmp_path / "train" / f"r_{index}.png")
        names.append(f"r_{index}")
    said = json.dumps(transforms(names, poses)).replace("images/", "./train/")
    (tmp_path / "transforms_train.json").write_text(said)
    found = imported(tmp_path)
    assert found.bounded and found.report.kind == "Blender"
    assert found.background.tolist() == [1, 1, 1]
    assert found.learned.images[0, 0, 0].tolist() == [255, 255, 255]
    assert found.learned.images[0, 18, 23].tolist() == [90, 90, 90]
    assert bool((found.box.upper > 0.38).all()) and float(found.box.size.max()) < 1.6


def test_blenders_test_split_judges(tmp_path: Path) -> None:
    poses = ring(8)
    names = write_pictures(tmp_path, poses)
    for split, part in (("train", slice(0, 5)), ("test", slice(5, 8))):
        (tmp_path / f"transforms_{split}.json").write_text(json.dumps(transforms(names[part], poses[part])))
    found = imported(tmp_path)
    assert (len(found.learned), len(found.held_out)) == (5, 3)


def test_a_few_missing_photographs_are_skipped_and_counted(tmp_path: Path) -> None:
    folder = write_transforms(tmp_path)
    (folder / "images" / "002.png").unlink()
    (folder / "images" / "005.png").write_text("no picture")
    report = imported(folder).report
    assert (report.images_named, report.images_used, report.images_skipped) == (8, 6, 2)


@pytest.mark.parametrize("broken", [False, True])
def test_most_photographs_missing_is_an_error_that_names_one(tmp_path: Path, broken: bool) -> None:
    folder = write_transforms(tmp_path)
    for index in range(1, 6):
        path = folder / "images" / f"00{index}.png"
        path.write_bytes(path.read_bytes()[:30]) if broken else path.unlink()
    with pytest.raises(CaptureError, match=r"names 8 photographs, but only 3 of them .* is images/001\.png"):
        imported(folder)


@pytest.mark.parametrize(("count", "size"), [(1, "1 photograph"), (3, "3 photographs")])
def test_a_capture_of_one_or_few_images_is_refused(tmp_path: Path, count: int, size: str) -> None:
    with pytest.raises(CaptureError, match=f"a capture of {size} is too small"):
        imported(write_transforms(tmp_path, ring(8)[:count]))


def test_photographs_from_one_place_are_refused(tmp_path: Path) -> None:
    eyes = torch.full((6, 3), 0.3)
    poses = look_at(eyes, eyes + torch.randn(6, 3, generator=torch.Generator().manual_seed(0)))
    with pytest.raises(CaptureError, match="taken from one place"):
        imported(write_transforms(tmp_path, poses))


def test_photographs_outside_of_a_visitors_folder_are_refused(tmp_path: Path) -> None:
    folder = write_transforms(tmp_path / "capture")
    (folder / "images" / "000.png").rename(tmp_path / "secret.png")
    changed(folder, lambda said: said["frames"][0].update(file_path="../secret.png"))
    assert imported(folder).report.images_used == 8
    with pytest.raises(CaptureError, match=r"outside of its own folder: \.\./secret\.png"):
        imported(folder, ImportConfig(within=folder))


def test_a_picture_of_a_wrong_shape_is_named(tmp_path: Path) -> None:
    folder = write_transforms(tmp_path)
    Image.new("RGB", (36, 48)).save(folder / "images" / "003.png")
    with pytest.raises(CaptureError, match=r"images/003\.png: .* was it cropped or turned"):
        imported(folder)


def test_a_folder_without_a_capture_is_refused_with_what_was_looked_for(tmp_path: Path) -> None:
    with pytest.raises(CaptureError, match=r"no transforms\.json .* no transforms_train\.json .* sparse/0"):
        imported(tmp_path)


@pytest.mark.parametrize("kind", ["transforms", "colmap"])
def test_a_capture_through_a_fisheye_is_straightened_and_its_lens_remembered(tmp_path: Path, kind: str) -> None:
    lens = (0.02, -0.004, 0.001, 0.0)
    if kind == "transforms":
        fisheye = Camera(100, 80, 31.0, 31.5, 51.0, 39.0, lens, fisheye=True)
        reported = dict(zip(("k1", "k2", "k3", "k4"), lens, strict=True))
        folder = write_transforms(tmp_path, camera=fisheye, camera_model="OPENCV_FISHEYE", **reported)
    else:  # which writes the size of the camera that all its tests have
        fisheye = replace(CAMERA, fx=16.0, fy=16.5, distortion=lens, fisheye=True)
        numbers = (16.0, 16.5, CAMERA.cx, CAMERA.cy, *lens)
        folder = write_colmap(tmp_path, True, (5, "OPENCV_FISHEYE", numbers), camera=fisheye)
    found = imported(folder)
    assert Camera.of_numbers(found.report.camera) == fisheye
    camera = found.learned.camera
    assert not camera.fisheye and 115 < 2 * math.degrees(math.atan(camera.width / camera.fx / 2)) <= 120
    expected = picture(camera, matrices(ring())[0])
    assert np.abs(found.learned.images[0].numpy().astype(float) - expected).mean() < 2


def test_lenses_of_two_phones_come_to_one_camera(tmp_path: Path) -> None:
    folder = changed(write_transforms(tmp_path), lambda said: said["frames"][1].update(fl_x=36.0, fl_y=36.0, cx=25.0))
    wider = replace(CAMERA, fx=36.0, fy=36.0, cx=25.0)
    Image.fromarray(picture(wider, matrices(ring())[1])).save(folder / "images" / "001.png")
    found = imported(folder)
    expected = picture(found.learned.camera, matrices(ring())[1])
    assert np.abs(found.learned.images[1].numpy().astype(float) - expected).mean() < 1


@pytest.mark.parametrize(
    ("placement", "message"),
    [
        ({"scale": 0.0}, "scale must be a number above 0"),
        ({"scale": 1.0, "picked": MeasuredDistance((0, 0, 0), (1, 0, 0), 1.0)}, "either a scale or two picked points"),
        ({"up": (0, 0, 0)}, "up must be a direction"),
        ({"box": ((0, 0, 0), (1, 0, 1))}, "lowest corner"),
    ],
)
def test_placements_that_no_place_can_have_are_refused(placement: dict, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        Placement(**placement)


@pytest.mark.parametrize(
    ("second", "meters", "message"),
    [((0, 0, 0), 1.0, "are the same"), ((1, 0, 0), -1.0, "distance must be a number above 0")],
)
def test_measured_distances_without_a_scale_are_refused(second: Vector, meters: float, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        MeasuredDistance((0, 0, 0), second, meters)


@pytest.mark.skipif("NERFNAV_TEST_DATA" not in os.environ, reason="photographs of others are not part of the project")
def test_fifty_real_photographs_of_sixty_seven_import(tmp_path: Path) -> None:
    found = imported(Path(os.environ["NERFNAV_TEST_DATA"]) / "fox", ImportConfig(downscale=16))
    report = found.report
    assert (report.images_named, report.images_used, report.images_skipped) == (67, 50, 17)
    assert (len(found.learned), len(found.held_out)) == (44, 6)
    assert found.learned.camera.height > 1.7 * found.learned.camera.width  # they were held upright
    # the fox hangs on a wall before the cameras; people held them level, as the file's own author found
    assert report.up[2] > 0.99
    assert found.box.contains(found.learned.poses.position).all()

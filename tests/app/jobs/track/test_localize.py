"""Localizing a picture as a job."""

from dataclasses import replace
from pathlib import Path
from typing import cast

import cv2
import PIL.ExifTags
import PIL.Image
import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.estimator.relocalize.global_localization import RelocaliseResult, RelocaliseStep
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.render.volume_rendering import render_image
from nerfnav.field.storage.checkpoint import save_field
from nerfnav.geometry.camera import FORWARD_MOUNT, Camera
from nerfnav.robots import CAMERA as ROBOTS_CAMERA
from nerfnav.robots.state import RigidState
from nerfnav_app.jobs.events import Progress
from nerfnav_app.jobs.track.camera import GivenCamera, camera_of, read_image
from nerfnav_app.jobs.track.localize import LocalizeRequest, find, run
from nerfnav_app.places.derived import build_searcher
from tests.app.doubles import balls_place
from tests.app.following import followed
from tests.estimator.places import voxel_balls

CAMERA = Camera.from_fov(96, 80, 80)
TRUTH = RigidState.at_rest((-0.35, 0.05, 0.28), 0.1)


@pytest.fixture(scope="module")
def request_here(tmp_path_factory: pytest.TempPathFactory) -> LocalizeRequest:
    """A field file, and a picture taken in it."""
    folder = tmp_path_factory.mktemp("localize")
    save_field(voxel_balls(), folder / "balls.npz")
    color = render_image(voxel_balls(), CAMERA, TRUTH.pose.compose(FORWARD_MOUNT)).color
    pixels = (255 * color.clamp(0, 1)).round().to(torch.uint8).numpy()
    cv2.imwrite(str(folder / "photo.png"), pixels[..., ::-1])
    return LocalizeRequest(str(folder / "balls.npz"), folder / "photo.png", GivenCamera(fov_deg=80))


@pytest.mark.slow
def test_a_picture_is_found_in_a_field_file(request_here: LocalizeRequest) -> None:
    events, finished = followed(run(request_here))
    fractions = [event.fraction for event in events if isinstance(event, Progress)]
    assert fractions == sorted(fractions) and fractions[-1] == 1
    summary = finished.summary
    assert summary["outcome"] == "found"
    assert torch.tensor(summary["position_m"]).sub(TRUTH.position).norm() < 0.02
    assert summary["yaw_rad"] == pytest.approx(0.1, abs=0.03)
    assert sum(one["weight"] for one in summary["candidates"]) == pytest.approx(1)


@pytest.mark.slow
def test_a_picture_of_the_robots_own_camera_is_found_in_an_open_place() -> None:
    place, truth = balls_place(), RigidState.at_rest((-0.45, 0.25, 0.3), -0.5)
    field = cast(VoxelField, place.field)
    place = replace(place, field=replace(field, info=replace(field.info, noise_std=0.01)))
    color = render_image(place.field, ROBOTS_CAMERA, truth.pose.compose(FORWARD_MOUNT)).color
    events, finished = followed(find(place, (255 * color.clamp(0, 1)).round().to(torch.uint8)))
    steps = [event for event in events if isinstance(event, RelocaliseStep)]
    assert finished.summary["outcome"] == "found"
    assert torch.tensor(finished.summary["position_m"]).sub(truth.position).norm() < 0.02
    assert len(steps[0].weights) > len(steps[-1].weights), "ever fewer places are left"
    assert [event.outcome.name for event in events if isinstance(event, RelocaliseResult)] == ["FOUND"]
    list(find(place, torch.zeros(200, 200, 3, dtype=torch.uint8)))
    assert build_searcher.cache_info().hits >= 1, "the place is looked around in once"


def test_intrinsics_take_the_place_of_the_field_of_view(request_here: LocalizeRequest) -> None:
    image = read_image(request_here.image)
    given = GivenCamera(intrinsics=(50.0, 51.0, 47.0, 41.0), fov_deg=90.0)
    assert camera_of(image, given)[0] == Camera(96, 80, 50.0, 51.0, 47.0, 41.0)
    with pytest.raises(InvalidInputError, match="focal lengths"):
        camera_of(image, GivenCamera(intrinsics=(0.0, 51.0, 47.0, 41.0)))


def test_a_calibration_counts_at_each_resolution_of_its_camera(tmp_path: Path) -> None:
    file = tmp_path / "camera.json"
    file.write_text('{"w": 192, "h": 160, "fl_x": 200, "fl_y": 202, "cx": 95, "cy": 81, "k1": -0.1}')
    small = torch.zeros(80, 96, 3, dtype=torch.uint8)
    camera, reported = camera_of(small, GivenCamera(file, fov_deg=20.0))
    assert camera == Camera(96, 80, 100.0, 101.0, 47.5, 40.5, (-0.1, 0.0, 0.0, 0.0, 0.0)) and "camera.json" in reported
    with pytest.raises(InvalidInputError, match="same proportions"):
        camera_of(torch.zeros(96, 80, 3, dtype=torch.uint8), GivenCamera(file))


@pytest.mark.parametrize(
    ("size", "last", "said"), [("32 24", "1e11", "cannot be undone"), ("1 24", "0", "calibrated with 1 x 24 pixels")]
)
def test_a_calibration_that_does_not_fit_the_picture_is_named(tmp_path: Path, size: str, last: str, said: str) -> None:
    file = tmp_path / "cameras.txt"
    file.write_text(f"1 OPENCV {size} 30 31 16 12 -0.2 0.05 0.001 {last}\n")
    with pytest.raises(InvalidInputError, match=f"cameras.txt: .*{said}"):
        camera_of(torch.zeros(24, 32, 3, dtype=torch.uint8), GivenCamera(file))


def test_a_picture_is_taken_for_one_of_the_fields_own_camera_where_nobody_says_otherwise(tmp_path: Path) -> None:
    remembered = Camera(192, 160, 200.0, 202.0, 95.0, 81.0, (-0.1, 0.0, 0.0, 0.0)).numbers
    camera, reported = camera_of(torch.zeros(80, 96, 3, dtype=torch.uint8), GivenCamera(), remembered)
    assert camera == Camera(96, 80, 100.0, 101.0, 47.5, 40.5, (-0.1, 0.0, 0.0, 0.0)) and "photographs" in reported
    other, reported = camera_of(torch.zeros(96, 80, 3, dtype=torch.uint8), GivenCamera(), remembered)
    assert other == Camera.from_fov(80, 96, 90) and reported == "guessed: 90 degrees"


def test_the_focal_length_in_a_pictures_exif_is_a_guess_that_is_told(tmp_path: Path) -> None:
    exif = PIL.Image.Exif()
    exif.get_ifd(PIL.ExifTags.IFD.Exif)[PIL.ExifTags.Base.FocalLengthIn35mmFilm] = 26
    PIL.Image.new("RGB", (96, 80)).save(tmp_path / "a.jpg", exif=exif)
    camera, reported = camera_of(read_image(tmp_path / "a.jpg"), GivenCamera(), path=tmp_path / "a.jpg")
    assert camera.fx == pytest.approx(26 / 43.27 * (96**2 + 80**2) ** 0.5) and reported == "guessed: 26 mm by EXIF"


def test_what_is_no_picture_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="there is no picture"):
        read_image(tmp_path / "none.png")
    (tmp_path / "text.png").write_text("hello")
    with pytest.raises(InvalidInputError, match="cannot be read"):
        read_image(tmp_path / "text.png")

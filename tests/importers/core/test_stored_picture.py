"""Pictures in files, which everything reads in one way."""

import io
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image, ImageOps

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import Camera
from nerfnav.importers.captures.pictures import read_pixels
from nerfnav.importers.captures.views import Lens
from nerfnav.importers.core.stored_picture import read_picture
from nerfnav.live.messages import Picture
from nerfnav.live.navigator import pixels_of
from nerfnav.tracking.sources.registry import SourceOptions, open_source
from nerfnav_app.jobs.track.camera import GivenCamera, read_image

UPRIGHT = Camera.from_fov(48, 32, 60)
PIXELS = np.random.default_rng(0).integers(0, 255, (32, 48, 3), np.uint8)
"""What viewers show."""


def turned(orientation: int, mode: str = "RGB", kind: str = "PNG") -> bytes:
    """A file that viewers show as PIXELS and whose pixels are stored turned."""
    back = {1: None, 2: 0, 3: 3, 4: 1, 5: 5, 6: 2, 7: 6, 8: 4}[orientation]
    image = Image.fromarray(PIXELS).convert(mode)
    image = image if back is None else image.transpose(Image.Transpose(back))
    exif = Image.Exif()
    exif[0x0112] = orientation
    stream = io.BytesIO()
    image.save(stream, kind, exif=exif)
    return stream.getvalue()


@pytest.mark.parametrize("orientation", range(1, 9))
def test_a_picture_of_an_unknown_camera_is_turned_upright_as_viewers_turn_it(orientation: int) -> None:
    data = turned(orientation)
    shown = ImageOps.exif_transpose(Image.open(io.BytesIO(data)))
    assert np.array_equal(np.asarray(shown), PIXELS)
    assert np.array_equal(read_picture(data).pixels, PIXELS)


@pytest.mark.parametrize("orientation", [5, 6, 7, 8])
def test_stored_pixels_that_have_the_cameras_proportions_are_left_as_they_are(orientation: int) -> None:
    data = turned(orientation)
    assert np.array_equal(read_picture(data, UPRIGHT.aspect).pixels, PIXELS)
    assert np.array_equal(read_picture(data, 1 / UPRIGHT.aspect).pixels, np.asarray(Image.open(io.BytesIO(data))))


def test_a_camera_held_upside_down_gives_its_pixels_as_they_are() -> None:
    data = turned(3)
    assert np.array_equal(read_picture(data, UPRIGHT.aspect).pixels, PIXELS[::-1, ::-1])


def test_training_localising_tracking_and_live_read_the_same_pixels(tmp_path: Path) -> None:
    data = turned(6, kind="JPEG")
    want = read_picture(data, UPRIGHT.aspect).pixels
    assert want.shape == PIXELS.shape
    path = tmp_path / "0.000000.jpg"
    path.write_bytes(data)
    lens = Lens.measured("a test", (48, 32), (40.0, 40.0), (24.0, 16.0))
    learned = read_pixels(path, lens)
    assert learned is not None and np.array_equal(learned, want)
    aspect = GivenCamera().aspect(UPRIGHT.numbers)
    assert np.array_equal(read_image(path, aspect).numpy(), want)
    (frame,) = open_source(tmp_path, SourceOptions(aspect=aspect)).frames()
    assert np.array_equal(frame.picture.numpy(), want)
    live = pixels_of(Picture(0.0, data), UPRIGHT)
    assert torch.equal(live, frame.picture)


def test_what_is_known_of_a_camera_tells_the_proportions_of_its_pictures() -> None:
    assert GivenCamera().aspect(()) is None
    assert GivenCamera(fov_deg=60.0).aspect(UPRIGHT.numbers) is None
    assert GivenCamera().aspect(UPRIGHT.numbers) == pytest.approx(1.5)


@pytest.mark.parametrize(("mode", "colored"), [("RGB", True), ("RGBA", True), ("L", False), ("P", True)])
def test_grey_pictures_are_distinguished_from_coloured_ones(mode: str, colored: bool) -> None:
    assert read_picture(turned(1, mode)).colored is colored


def test_what_is_no_whole_picture_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="no whole JPEG or PNG"):
        read_picture(turned(1)[:200])

"""COLMAP's sparse models, text and binary: cameras and images, as its format description lays them out.

COLMAP gives T_camera_world with OpenCV axes (x right, y down, looking along z) and pixel centres at half numbers.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from nerfnav.errors import InvalidInputError
from nerfnav.geometry import ColmapBytes, ColmapCamera, colmap_cameras, colmap_lines, so3
from nerfnav.importers.captures.views import LARGEST, CaptureError, Lens, View, Views

MODEL_FOLDERS = ("sparse/0", "sparse", "colmap/sparse/0")
"""Where a capture keeps its model."""
_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])


@dataclass(frozen=True)
class _Image:
    name: str
    camera: int
    quaternion: tuple[float, ...]  # camera_world, wxyz
    translation: tuple[float, ...]


def model_folder(folder: Path) -> Path | None:
    """The folder in which a capture's model lies; None where there is none."""
    found = (folder / name for name in MODEL_FOLDERS if _has_model(folder / name))
    return next(found, None)


def read_colmap(folder: Path) -> Views:
    """What the model in a capture's folder says. Raises CaptureError where it cannot be used."""
    model = model_folder(folder)
    if model is None:
        raise CaptureError(f"{folder} has no COLMAP model")
    binary = (model / "cameras.bin").is_file() and (model / "images.bin").is_file()
    try:
        cameras = colmap_cameras(model / ("cameras.bin" if binary else "cameras.txt"))
        lenses = {camera.number: _lens(camera) for camera in cameras}
        images = list(_binary_images(model / "images.bin") if binary else _text_images(model / "images.txt"))
    except InvalidInputError as error:
        raise CaptureError(str(error)) from error
    pictures = folder / "images" if (folder / "images").is_dir() else folder
    views = []
    for image in images:
        if image.camera not in lenses:
            raise CaptureError(f"{image.name} was taken by camera {image.camera}, which {model} does not describe")
        views.append(View(image.name, pictures / image.name, lenses[image.camera], _pose(image)))
    if not views:
        raise CaptureError(f"the COLMAP model in {model} has no images")
    return Views("COLMAP", tuple(sorted(views, key=lambda view: view.name)))


def _has_model(folder: Path) -> bool:
    return any(all((folder / f"{name}.{kind}").is_file() for name in ("cameras", "images")) for kind in ("bin", "txt"))


def _pose(image: _Image) -> np.ndarray:
    large = not (np.abs([*image.quaternion, *image.translation]) < LARGEST).all()
    if large or np.linalg.norm(image.quaternion) < 1e-6:
        raise CaptureError(f"the pose of {image.name} is no pose: its quaternion is zero or has NaN")
    R_camera_world = so3.matrix_from_quaternion(torch.tensor(image.quaternion, dtype=torch.float64)).numpy()
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = R_camera_world.T, -R_camera_world.T @ image.translation
    return pose @ _OPENGL


def _lens(camera: ColmapCamera) -> Lens:
    lens = Lens.measured(camera.size, camera.focal, camera.center, *camera.distortion)
    return lens.as_fisheye() if camera.fisheye else lens


def _text_images(path: Path) -> Iterator[_Image]:
    """Images have two lines each, the second of which may be empty."""
    lines = iter(colmap_lines(path))
    for line in lines:
        if not line.strip() or line.startswith("#"):
            continue
        try:
            _, qw, qx, qy, qz, tx, ty, tz, camera, name = line.strip().split(maxsplit=9)
            quaternion, translation = (qw, qx, qy, qz), (tx, ty, tz)
            yield _Image(name, int(camera), tuple(map(float, quaternion)), tuple(map(float, translation)))
        except ValueError as error:
            raise CaptureError(f"{path} has a line that describes no image: {line[:60]!r}") from error
        next(lines, None)


def _binary_images(path: Path) -> Iterator[_Image]:
    data = ColmapBytes(path)
    for _ in range(data.integer("Q")):
        data.skip(4)  # the image's own number
        pose, camera, name = data.numbers("7d"), data.integer("i"), data.text()
        data.skip(24 * data.integer("Q"))  # the points that were seen
        yield _Image(name, camera, pose[:4], pose[4:])

"""COLMAP's sparse models, text and binary: cameras and images, as its format description lays them out.

COLMAP gives T_camera_world with OpenCV axes (x right, y down, looking along z) and pixel centres at half numbers.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from nerfnav.geometry import so3
from nerfnav.importers.captures.views import LARGEST, CaptureError, Lens, View, Views

MODEL_FOLDERS = ("sparse/0", "sparse", "colmap/sparse/0")
"""Where a capture keeps its model."""
_MODELS = {
    "SIMPLE_PINHOLE": (0, 3), "PINHOLE": (1, 4), "SIMPLE_RADIAL": (2, 4), "RADIAL": (3, 5), "OPENCV": (4, 8),
    "FULL_OPENCV": (6, 12),
}  # fmt: skip
"""Number and parameter count of each known model."""
_OTHER_MODELS = {
    5: "OPENCV_FISHEYE", 7: "FOV", 8: "SIMPLE_RADIAL_FISHEYE", 9: "RADIAL_FISHEYE", 10: "THIN_PRISM_FISHEYE",
}  # fmt: skip
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
    lenses = dict(_binary_cameras(model / "cameras.bin") if binary else _text_cameras(model / "cameras.txt"))
    images = _binary_images(model / "images.bin") if binary else _text_images(model / "images.txt")
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


def _lens(model: str, size: tuple[float, float], numbers: tuple[float, ...], where: str) -> Lens:
    if model not in _MODELS:
        raise CaptureError(f"{where} has the camera model {model}; known are: {', '.join(_MODELS)}")
    if len(numbers) != _MODELS[model][1]:
        raise CaptureError(f"{where} has {len(numbers)} numbers, but the model {model} has {_MODELS[model][1]}")
    # the models with "SIMPLE" or "RADIAL" in their names have one focal length
    single = "SIMPLE" in model or "RADIAL" in model
    fx, (fy, *rest) = numbers[0], numbers[0:] if single else numbers[1:]
    cx, cy, *distortion = rest
    return Lens.measured(size, (fx, fy), (cx, cy), *distortion)


def _lines(path: Path) -> list[str]:
    try:
        return path.read_text(encoding="utf-8").splitlines()
    except UnicodeDecodeError as error:
        raise CaptureError(f"{path} is not text: a binary model ends in .bin") from error


def _text_cameras(path: Path) -> Iterator[tuple[int, Lens]]:
    for line in _lines(path):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        try:
            number, model, width, height, *parameters = words
            values = tuple(float(word) for word in parameters)
            size = (float(width), float(height))
            camera = int(number)
        except ValueError as error:
            raise CaptureError(f"{path} has a line that describes no camera: {line[:60]!r}") from error
        yield camera, _lens(model, size, values, f"camera {camera} in {path}")


def _text_images(path: Path) -> Iterator[_Image]:
    """Images have two lines each, the second of which may be empty."""
    lines = iter(_lines(path))
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


class _Bytes:
    """Reads a binary file from its start, and says so where it ends too early."""

    def __init__(self, path: Path) -> None:
        self._path, self._data, self._at = path, path.read_bytes(), 0

    def numbers(self, layout: str) -> tuple[float, ...]:
        size = struct.calcsize("<" + layout)
        self._require(size)
        self._at += size
        return struct.unpack_from("<" + layout, self._data, self._at - size)

    def integer(self, layout: str) -> int:
        return int(self.numbers(layout)[0])

    def skip(self, size: int) -> None:
        self._require(size)
        self._at += size

    def text(self) -> str:
        end = self._data.find(b"\0", self._at)
        self._require(1 if end < 0 else end - self._at + 1, end >= 0)
        start, self._at = self._at, end + 1
        return self._data[start:end].decode("utf-8", "replace")

    def _require(self, size: int, found: bool = True) -> None:
        if not found or self._at + size > len(self._data):
            raise CaptureError(f"{self._path} is cut off, or no COLMAP model")


def _binary_cameras(path: Path) -> Iterator[tuple[int, Lens]]:
    data = _Bytes(path)
    names = {number: (name, count) for name, (number, count) in _MODELS.items()}
    for _ in range(data.integer("Q")):
        camera, model, width, height = (int(number) for number in data.numbers("iiQQ"))
        where = f"camera {camera} in {path}"
        if model not in names:
            raise CaptureError(
                f"{where} has the camera model {_OTHER_MODELS.get(model, model)}; known are: {', '.join(_MODELS)}"
            )
        name, count = names[model]
        yield camera, _lens(name, (width, height), data.numbers(f"{count}d"), where)


def _binary_images(path: Path) -> Iterator[_Image]:
    data = _Bytes(path)
    for _ in range(data.integer("Q")):
        data.skip(4)  # the image's own number
        pose, camera, name = data.numbers("7d"), data.integer("i"), data.text()
        data.skip(24 * data.integer("Q"))  # the points that were seen
        yield _Image(name, camera, pose[:4], pose[4:])

"""COLMAP's sparse models, text and binary: cameras, images and points, as its format description lays them out.

COLMAP gives T_camera_world with OpenCV axes (x right, y down, looking along z) and pixel centres at half numbers.

Points are where rays of matched features met, with the tracks of images that show them.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import ColmapBytes, ColmapCamera, colmap_cameras, colmap_lines, colmap_rows, so3
from nerfnav.importers.captures.views import LARGEST, CaptureError, Lens, Tracks, View, Views

_SHORTEST = 3
"""Images in which a point must have been seen: two agree by chance."""
_WRONG = 2.0
"""Mean distance of a point from its features above which it is none [pixels]."""


@dataclass(frozen=True)
class _Point:
    position: tuple[float, ...]
    error: float  # of reprojection [pixels]
    images: tuple[int, ...]  # numbers of those that show it


def read_points(model: Path, names: dict[int, str]) -> Tracks | None:
    """The points of a model that are to be trusted, in its images `names` by number; None where it keeps none.

    Raises CaptureError for a file that is cut off or no list of points, InvalidInputError for one that is not text.
    """
    binary, text = model / "points3D.bin", model / "points3D.txt"
    if not binary.is_file() and not text.is_file():
        return None
    points, images, numbers = [], [], []
    for point in _binary_points(binary) if binary.is_file() else _text_points(text):
        seen_from = {names[image] for image in point.images if image in names}
        if len(seen_from) < _SHORTEST or not point.error <= _WRONG or not (np.abs(point.position) < LARGEST).all():
            continue
        images += sorted(seen_from)
        numbers += len(seen_from) * [len(points)]
        points.append(point.position)
    return Tracks(np.array(points).reshape(-1, 3), tuple(images), np.array(numbers, int)) if points else None


def _text_points(path: Path) -> Iterator[_Point]:
    for line in colmap_rows(path):
        words = line.split()
        try:
            _, *position = map(float, words[:4])
            yield _Point(tuple(position), float(words[7]), tuple(map(int, words[8::2])))
        except (ValueError, IndexError) as error:
            raise CaptureError(f"{path} has a line that describes no point: {line[:60]!r}") from error


def _binary_points(path: Path) -> Iterator[_Point]:
    data = ColmapBytes(path)
    for _ in range(data.integer("Q")):
        data.skip(8)  # the point's own number
        position = data.numbers("3d")
        data.skip(3)  # its colour
        yield _Point(position, data.numbers("d")[0], tuple(map(int, data.numbers(f"{2 * data.integer('Q')}i")[::2])))


MODEL_FOLDERS = ("sparse/0", "sparse", "colmap/sparse/0")
"""Folders in which a capture may keep its model."""
_MOVED = 1e-3
"""Largest difference between camera positions and those of the model, in extents of the positions."""
_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])


@dataclass(frozen=True)
class _Image:
    number: int
    name: str
    camera: int
    quaternion: tuple[float, ...]  # camera_world, wxyz
    translation: tuple[float, ...]


def find_colmap(folder: Path) -> tuple[Path, Path] | None:
    """The folder of a capture and that of its model; None where it has none."""
    return next(((folder, folder / name) for name in MODEL_FOLDERS if _has_model(folder / name)), None)


def read_colmap(folders: tuple[Path, Path]) -> Views:
    """Read the COLMAP model that `find_colmap` has found. Raises CaptureError where it cannot be used."""
    folder, model = folders
    try:
        cameras = colmap_cameras(model / ("cameras.bin" if _is_binary(model) else "cameras.txt"))
        lenses = {camera.number: _lens(camera) for camera in cameras}
        images = _images(model)
        tracks = read_points(model, {image.number: image.name for image in images})
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
    return Views("COLMAP", tuple(sorted(views, key=lambda view: view.name)), tracks)


def read_tracks_beside(folder: Path, views: tuple[View, ...]) -> Tracks | None:
    """The points of the COLMAP model from which other files of a capture were made, as nerfstudio leaves it there.

    None where there is no model, or the cameras of `views` were moved since. Raises CaptureError for a broken one.
    """
    model = folder / MODEL_FOLDERS[-1]
    if not _has_model(model):
        return None
    called = {Path(view.name).name: view for view in views}
    try:
        images = {image.number: image for image in _images(model) if Path(image.name).name in called}
        taken = {number: called[Path(image.name).name] for number, image in images.items()}
        if not taken or not _alike([_pose(image) for image in images.values()], list(taken.values())):
            return None
        return read_points(model, {number: view.name for number, view in taken.items()})
    except InvalidInputError as error:
        raise CaptureError(str(error)) from error


def _alike(poses: list[np.ndarray], views: list[View]) -> bool:
    """True where cameras have the positions of poses (4, 4) up to rounding."""
    there, here = (np.stack(each)[:, :3, 3] for each in (poses, [view.pose for view in views]))
    return bool(np.abs(there - here).max() <= _MOVED * np.ptp(there, axis=0).max())


def _is_binary(model: Path) -> bool:
    return (model / "cameras.bin").is_file() and (model / "images.bin").is_file()


def _images(model: Path) -> list[_Image]:
    return list(_binary_images(model / "images.bin") if _is_binary(model) else _text_images(model / "images.txt"))


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
    return Lens.measured(camera.size, camera.focal, camera.center, *camera.distortion, fisheye=camera.fisheye)


def _text_images(path: Path) -> Iterator[_Image]:
    """Images have two lines each, the second of which may be empty."""
    lines = iter(colmap_lines(path))
    for line in lines:
        if not line.strip() or line.startswith("#"):
            continue
        try:
            number, *words, camera, name = line.strip().split(maxsplit=9)
            qw, qx, qy, qz, tx, ty, tz = map(float, words)
            yield _Image(int(number), name, int(camera), (qw, qx, qy, qz), (tx, ty, tz))
        except ValueError as error:
            raise CaptureError(f"{path} has a line that describes no image: {line[:60]!r}") from error
        next(lines, None)


def _binary_images(path: Path) -> Iterator[_Image]:
    data = ColmapBytes(path)
    for _ in range(data.integer("Q")):
        number, pose, camera, name = data.integer("i"), data.numbers("7d"), data.integer("i"), data.text()
        data.skip(24 * data.integer("Q"))  # the points that were seen
        yield _Image(number, name, camera, pose[:4], pose[4:])

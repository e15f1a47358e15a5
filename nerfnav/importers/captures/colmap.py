"""Captures by COLMAP: find a model and its pictures in a folder, and read their views and tracks.

Of several models, which COLMAP makes where it cannot join the pictures, the one with the most images counts.
"""

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.formats import LARGEST, PICTURE_FOLDERS, ColmapCamera, ColmapImage, ColmapModel, NamedFiles
from nerfnav.geometry import so3
from nerfnav.importers.captures.views import CaptureError, Lens, Tracks, View, Views
from nerfnav.importers.core.placement import OPENGL

MODEL_FOLDERS = ("sparse", "colmap/sparse", "distorted/sparse", ".")
"""Folders of a capture in which models lie, or in whose numbered folders they do."""
_PICTURES = (*PICTURE_FOLDERS[1:], PICTURE_FOLDERS[0])
"""Folders of pictures beside a model or around it; the one that has the most of its pictures counts."""
_SHORTEST = 3
"""Images in which a point must have been seen: two agree by chance."""
_WRONG = 2.0
"""Mean distance of a point from its features above which it is none [pixels]."""
_MOVED = 1e-3
"""Largest difference between camera positions and those of the model, in extents of the positions."""


@dataclass(frozen=True)
class FoundModels:
    """The models of one capture."""

    folder: Path
    """Of the capture."""
    models: tuple[ColmapModel, ...]
    """At least one, which may lack files."""


def find_colmap(folder: Path) -> FoundModels | None:
    """Find the models of a capture; None where it has none.

    The folders of MODEL_FOLDERS come in their order. Models that lack their images count only where all do.
    """
    begun: list[ColmapModel] = []
    for name in MODEL_FOLDERS:
        parent = folder / name
        numbered = sorted(path for path in parent.glob("[0-9]*") if path.name.isdecimal() and path.is_dir())
        models = [ColmapModel(path) for path in (parent, *numbered)]
        whole = tuple(model for model in models if model.missing() is None)
        if whole:
            return FoundModels(folder, whole)
        begun += [model for model in models if model.is_begun() and name != "."]
    return FoundModels(folder, tuple(begun)) if begun else None


def read_colmap(found: FoundModels) -> Views:
    """Read the model with the most images that `find_colmap` has found. Raises CaptureError where it is unusable."""
    try:
        read = [(model, model.images()) for model in found.models]
        model, images = max(read, key=lambda pair: len(pair[1]))
        if not images:
            raise CaptureError(f"the COLMAP model in {model.folder} has no images")
        cameras = model.cameras()
        unknown = next((image for image in images if image.camera not in cameras), None)
        if unknown is not None:
            raise CaptureError(
                f"{unknown.name} was taken by camera {unknown.camera}, which {model.folder} does not describe"
            )
        lenses = {number: _lens(cameras[number]) for number in {image.camera for image in images}}
        tracks = read_points(model, {image.number: image.name for image in images})
    except InvalidInputError as error:
        raise CaptureError(str(error)) from error
    poses = [_pose(image) for image in images]
    pictures = _find_pictures(found.folder, model.folder, [image.name for image in images])
    views = [
        View(each.name, pictures[each.name], lenses[each.camera], pose)
        for each, pose in zip(images, poses, strict=True)
    ]
    counts = {str(each.folder.relative_to(found.folder)): len(named) for each, named in read}
    chosen = counts.pop(str(model.folder.relative_to(found.folder)))
    others = ", ".join(f"{name} has {count}" for name, count in counts.items())
    name = model.folder.relative_to(found.folder)
    guesses = (f"model: {name}, which has {chosen} pictures ({others})",) if others else ()
    return Views("COLMAP", tuple(sorted(views, key=lambda view: view.name)), tracks, guesses=guesses)


def _find_pictures(folder: Path, model: Path, names: list[str]) -> dict[str, Path]:
    """Find the files of a model's pictures by their names, in the folder that has the most of them.

    Folders around the model count where the capture itself has none. Raises CaptureError where there are none at all.
    """
    for roots in ((folder, model), model.parents[:2]):
        places = [root / name for root in dict.fromkeys(roots) for name in _PICTURES if (root / name).is_dir()]
        named = [{name: files.find(name) for name in names} for files in map(NamedFiles, places)]
        counts = [sum(map(os.path.isfile, paths.values())) for paths in named]
        if any(counts):
            return named[int(np.argmax(counts))]
    raise CaptureError(
        f"the capture names {len(names)} photographs, but none of them is there: {names[0]} is the first, looked for "
        f"in {folder}, in {', '.join(f'{name}/' for name in _PICTURES if name)} there, and beside the model"
    )


def read_points(model: ColmapModel, names: dict[int, str]) -> Tracks | None:
    """The points of a model that are to be trusted, in its images `names` by number; None where it keeps none.

    Raises InvalidInputError for a file that is cut off or no list of points.
    """
    points, images, numbers = [], [], []
    for point in model.points():
        seen_from = {names[image] for image in point.images if image in names}
        if len(seen_from) < _SHORTEST or not point.error <= _WRONG or not (np.abs(point.position) < LARGEST).all():
            continue
        images += sorted(seen_from)
        numbers += len(seen_from) * [len(points)]
        points.append(point.position)
    return Tracks(np.array(points).reshape(-1, 3), tuple(images), np.array(numbers, int)) if points else None


def read_tracks_beside(folder: Path, views: tuple[View, ...]) -> Tracks | None:
    """The points of the COLMAP model from which other files of a capture were made, as nerfstudio leaves it there.

    None where there is no model, or the cameras of `views` were moved since. Raises CaptureError for a broken one.
    """
    model = ColmapModel(folder / "colmap" / "sparse" / "0")
    if model.missing() is not None:
        return None
    called = {Path(view.name).name: view for view in views}
    try:
        images = {image.number: image for image in model.images() if Path(image.name).name in called}
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


def _pose(image: ColmapImage) -> np.ndarray:
    large = not (np.abs([*image.quaternion, *image.translation]) < LARGEST).all()
    if large or np.linalg.norm(image.quaternion) < 1e-6:
        raise CaptureError(f"the pose of {image.name} is no pose: its quaternion is zero or has NaN")
    R_camera_world = so3.matrix_from_quaternion(torch.tensor(image.quaternion, dtype=torch.float64)).numpy()
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = R_camera_world.T, -R_camera_world.T @ image.translation
    return pose @ OPENGL


def _lens(camera: ColmapCamera) -> Lens:
    camera.require_known()
    return Lens.measured(
        camera.where, camera.size, camera.focal, camera.center, *camera.distortion, fisheye=camera.fisheye
    )

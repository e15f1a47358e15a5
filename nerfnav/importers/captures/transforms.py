"""Captures described by JSON: transforms.json of nerfstudio and instant-ngp, and Blender's one file for each split.

nerfnav/formats/transforms.py has the format. Cameras are OpenGL, as here.
"""

from functools import reduce
from pathlib import Path

from nerfnav.core.errors import InvalidInputError
from nerfnav.formats import KeyReport, NamedFiles, Transforms, depth_unit, lens_of, read_transforms, undo_applied
from nerfnav.formats.transforms import Frame
from nerfnav.importers.captures.colmap import read_tracks_beside
from nerfnav.importers.captures.views import CaptureError, DepthFile, Lens, MaskFile, View, Views, rigid_pose

SPLITS = ("train", "val", "test")
"""Blender's files are called transforms_{split}.json."""
_DEPTHS = (".png", ".tif", ".tiff", ".npy", ".exr")
"""Endings of depth maps."""
_MILLIMETRE = 0.001
"""Default unit of nerfstudio's depth maps, in the capture's units."""


def find_transforms(folder: Path) -> Path | None:
    """The transforms.json of a folder; None where it has none."""
    path = folder / "transforms.json"
    return path if path.is_file() else None


def find_blender(folder: Path) -> dict[str, Path]:
    """The files in a folder for Blender's splits, by the name of their split."""
    files = {split: folder / f"transforms_{split}.json" for split in SPLITS}
    return {split: file for split, file in files.items() if file.is_file()}


def read_capture(path: Path) -> Views:
    """Read a transforms.json as a capture. Raises CaptureError where it is unusable."""
    found = _views(path)
    return Views("transforms.json", found.views, read_tracks_beside(path.parent, found.views), found.keys)


def read_blender(files: dict[str, Path]) -> Views:
    """Read transforms_{train,val,test}.json; beside a training split the others are held out."""
    parts = [_views(file, test="train" in files and split != "train") for split, file in files.items()]
    keys = reduce(KeyReport.merge, (part.keys for part in parts))
    return Views("Blender", tuple(view for part in parts for view in part.views), keys=keys)


def _views(path: Path, test: bool = False) -> Views:
    try:
        record, keys = read_transforms(path)
        if not record.frames:
            raise InvalidInputError(f"{path} has no list of frames: it is not a transforms.json")
        undo = undo_applied(record, path)
        files = NamedFiles(path.parent)
        held_out = _held_out(record, files)
        views = []
        for frame in record.frames:
            view = _view(record, frame, files, path)
            view = view if undo is None else view.transformed(undo)
            views.append(view.judging() if test or view.path in held_out else view)
    except InvalidInputError as error:
        raise CaptureError(str(error)) from error
    return Views("", tuple(views), keys=keys)


def _view(record: Transforms, frame: Frame, files: NamedFiles, path: Path) -> View:
    where = f"{frame.file_path} in {path}"
    if frame.transform_matrix is None:
        raise InvalidInputError(f"{where} has no transform_matrix")
    return View(
        frame.file_path,
        files.find_picture(frame.file_path),
        _lens(record, frame, where),
        rigid_pose(frame.transform_matrix, where),
        depth=_depth(record, frame, files),
        mask=None if frame.mask_path is None else MaskFile(files.find(frame.mask_path)),
    )


def _held_out(record: Transforms, files: NamedFiles) -> set[Path]:
    """Photographs that nerfstudio's lists do not leave to learn from."""
    judging = {files.find_picture(name) for name in (*(record.val_filenames or ()), *(record.test_filenames or ()))}
    if record.train_filenames is None:
        return judging
    learned = {files.find_picture(name) for name in record.train_filenames}
    return judging | ({files.find_picture(frame.file_path) for frame in record.frames} - learned)


def _depth(record: Transforms, frame: Frame, files: NamedFiles) -> DepthFile | None:
    """A frame's depth map, if it has one that is to be read."""
    name, unit = frame.depth_path, depth_unit(record)
    if frame.depth_file_path is not None:
        name = frame.depth_file_path
        unit = frame.depth_unit_scale_factor or record.depth_unit_scale_factor or _MILLIMETRE
    return None if name is None or unit is None else DepthFile(files.find(name, _DEPTHS), unit)


def _lens(record: Transforms, frame: Frame, where: str) -> Lens:
    lens = lens_of(record, frame, where)
    if lens.size is None:
        distortion = lens.distortion if any(lens.distortion) else ()
        return Lens(lens.fx, lens.fy, distortion=distortion, fisheye=lens.fisheye)
    fy = lens.fx if lens.fy is None else lens.fy
    return Lens.measured(where, lens.size, (lens.fx, fy), (lens.cx, lens.cy), *lens.distortion, fisheye=lens.fisheye)

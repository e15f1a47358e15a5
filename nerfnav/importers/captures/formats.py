"""Capture formats: detect the format of a folder or file, and read its views."""

from collections.abc import Callable
from pathlib import Path

from nerfnav.importers.captures import colmap, nerfstudio_run, polycam, record3d, scanner, transforms
from nerfnav.importers.captures.views import CaptureError, Views

_FOLDERS: tuple[tuple[Callable[[Path], bool], Callable[[Path], Views]], ...] = (
    (transforms.is_transforms, transforms.read_transforms),
    (transforms.is_blender, transforms.read_blender),
    (lambda folder: colmap.model_folder(folder) is not None, colmap.read_colmap),
    (polycam.is_polycam, polycam.read_polycam),
    (record3d.is_record3d, record3d.read_record3d),
    (scanner.is_scanner, scanner.read_scanner),
)
"""What tells each kind of folder, and what reads it; the first that takes it does."""


def is_capture(path: Path) -> bool:
    """Whether a folder holds the files of a capture of any kind, or a file is a nerfstudio run's configuration."""
    if path.is_file():
        return path.name == nerfstudio_run.CONFIG and nerfstudio_run.is_run(path)
    return nerfstudio_run.is_run(path) or any(takes(path) for takes, _ in _FOLDERS)


def read_views(path: Path) -> Views:
    """What the files of a capture say: a folder, a transforms.json, or the config.yml of a nerfstudio run.

    Raises CaptureError where it is no capture, or one that cannot be used.
    """
    if nerfstudio_run.is_run(path):
        run = nerfstudio_run.read_run(path)
        return nerfstudio_run.moved(read_views(run.data), run)
    if path.is_file():
        return transforms.read_transforms(path)
    for takes, read in _FOLDERS:
        if takes(path):
            return read(path)
    raise CaptureError(
        f"{path} is no capture: there is no transforms.json (nerfstudio, instant-ngp), no transforms_train.json "
        f"(Blender), no cameras and images, .bin or .txt, in {' or '.join(colmap.MODEL_FOLDERS)} (COLMAP), no "
        "keyframes (Polycam), no metadata with rgb or rgbd (Record3D) and no frame_00000.json (3D Scanner App)"
    )

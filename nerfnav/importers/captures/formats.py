"""Capture formats: detect the format of a folder or file, and read its views."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from nerfnav.importers.captures import colmap, nerfstudio_run, phones, transforms, tum
from nerfnav.importers.captures.views import CaptureError, Views


@dataclass(frozen=True)
class CaptureFormat:
    """Format of capture folders."""

    find: Callable[[Path], Any]
    """Finds the files or folders of such a capture in a folder; None, or none of them, in one of another format."""
    read: Callable[[Any], Views]
    """Reads what was found."""


FORMATS = (
    CaptureFormat(transforms.find_transforms, transforms.read_capture),
    CaptureFormat(transforms.find_blender, transforms.read_blender),
    CaptureFormat(colmap.find_colmap, colmap.read_colmap),
    CaptureFormat(tum.find_tum, tum.read_tum),
    CaptureFormat(phones.find_polycam, phones.read_polycam),
    CaptureFormat(phones.find_record3d, phones.read_record3d),
    CaptureFormat(phones.find_scanner, phones.read_scanner),
)
"""Formats of capture folders; the first that matches reads the folder."""


def is_capture(path: Path) -> bool:
    """True for a folder that holds a capture of any format, and for the configuration file of a nerfstudio run."""
    if path.is_file():
        return path.name == nerfstudio_run.CONFIG and nerfstudio_run.is_run(path)
    return nerfstudio_run.is_run(path) or any(form.find(path) for form in FORMATS)


def read_views(path: Path) -> Views:
    """Read the views of a capture: a folder, a transforms.json, or the config.yml of a nerfstudio run.

    Raises CaptureError where it is no capture, or one that cannot be used.
    """
    if nerfstudio_run.is_run(path):
        run = nerfstudio_run.read_run(path)
        return nerfstudio_run.transform_to_run(read_views(run.data), run)
    if path.is_file():
        return transforms.read_capture(path)
    for form in FORMATS:
        if found := form.find(path):
            return form.read(found)
    raise CaptureError(
        f"{path} is no capture: there is no transforms.json (nerfstudio, instant-ngp), no transforms_train.json "
        f"(Blender), no cameras and images, .bin or .txt, in {'/0 or '.join(colmap.MODEL_FOLDERS[:-1])}/0 (COLMAP), "
        "no rgb.txt with groundtruth.txt (TUM RGB-D), no keyframes (Polycam), no metadata with rgb or rgbd (Record3D) "
        "and no frame_00000.json (3D Scanner App)"
    )

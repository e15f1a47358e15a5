"""Mesh folders and archives: find the mesh in Gazebo's models (meshes/ beside materials/textures/) and single ones."""

from collections.abc import Sequence
from pathlib import Path, PurePath, PurePosixPath
from typing import TypeVar

from nerfnav.importers.captures.archive import names_in
from nerfnav.importers.captures.views import CaptureError
from nerfnav.importers.core.errors import MeshFileError
from nerfnav.importers.meshes.files import SUFFIXES

AnyPath = TypeVar("AnyPath", bound=PurePath)
_OF_CAPTURES = ("transforms", "cameras.", "images.", "keyframes", "frame_0", "rgbd", "metadata")
"""How files or folders begin that only captures have; theirs may hold a mesh too."""
_SECOND_RATE = (".stl", ".ply")
"""Formats without pictures, which models have beside others for collisions."""


def meshes_in_archive(archive: Path) -> list[str]:
    """Names of the meshes in a .zip that is no capture; none where it cannot be read, which readers tell."""
    try:
        names = [name for name in names_in(archive) if not name.startswith("__MACOSX/")]
    except (CaptureError, OSError):
        return []
    if any(part.startswith(_OF_CAPTURES) for name in names for part in PurePosixPath(name).parts):
        return []
    return [name for name in names if PurePosixPath(name).suffix.lower() in SUFFIXES]


def mesh_in(folder: Path) -> Path | None:
    """The mesh of a folder: the only one in it, or in its meshes/ as Gazebo's models have it; None where none is.

    Folders of several, of formats with pictures, are several places.
    """
    for place in (folder, folder / "meshes"):
        if not place.is_dir():
            continue
        found = [entry for entry in place.iterdir() if entry.suffix.lower() in SUFFIXES and entry.is_file()]
        if found:
            return only_one(found)
    return None


def only_one(meshes: Sequence[AnyPath]) -> AnyPath | None:
    """The mesh that is meant by several: the only one, else the only one of a format with pictures; None for others."""
    painted = [mesh for mesh in meshes if mesh.suffix.lower() not in _SECOND_RATE]
    best = painted if len(painted) == 1 else meshes
    return best[0] if len(best) == 1 else None


def mesh_file(source: Path) -> Path:
    """The mesh that is meant by a file or a folder. Raises MeshFileError where a folder holds none or several."""
    if not source.is_dir():
        return source
    found = mesh_in(source)
    if found is None:
        raise MeshFileError(f"{source} holds no mesh or several of them: name one of its files")
    return found

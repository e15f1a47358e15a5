"""Mesh files: read those of all formats, and find the mesh that is meant by a folder or an archive.

A file's own declarations decide where a format leaves them open: glTF is in metres and Y-up, Collada names its unit
and its up axis, the others declare nothing. Files that a mesh names are read from its own folder and nowhere else.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePath, PurePosixPath
from typing import TypeVar

from nerfnav.core.errors import MissingExtraError
from nerfnav.core.files import require_fetched
from nerfnav.formats import list_folder
from nerfnav.importers.captures.archive import list_names
from nerfnav.importers.captures.views import CaptureError
from nerfnav.importers.core.errors import MeshFileError, first_line
from nerfnav.importers.core.kinds import MESHES as SUFFIXES
from nerfnav.importers.core.kinds import names_capture
from nerfnav.importers.meshes.dae import read_dae
from nerfnav.importers.meshes.gltf import read_gltf
from nerfnav.importers.meshes.obj import read_obj
from nerfnav.importers.meshes.parts import DamagedMeshError, Part
from nerfnav.importers.meshes.ply import read_ply_mesh
from nerfnav.importers.meshes.resolver import FolderResolver
from nerfnav.importers.meshes.stl_off import read_off, read_stl


@dataclass(frozen=True)
class Declaration:
    """Declared axes and unit of a format or a file."""

    up: str
    """Axis that points up: x, y or z."""
    up_is_certain: bool
    """True where the file itself declares it, not only the convention of its format."""
    meters: float | None
    """Length of its unit [m]; None where it is not declared."""
    units: tuple[str, ...]
    """Units to try where none is declared, the likeliest first."""


Reader = Callable[[Path, bytes, FolderResolver], list[Part]]
"""Reads the bytes of a file, and others beside it; raises DamagedMeshError where they are not whole."""
_Y_UP = Declaration("y", False, None, ("m", "cm", "mm"))
_Z_UP = Declaration("z", False, None, ("m", "mm", "cm"))
FORMATS: dict[str, tuple[Declaration, Reader]] = {
    ".glb": (_Y_UP, read_gltf),
    ".gltf": (_Y_UP, read_gltf),
    ".obj": (_Y_UP, read_obj),
    ".ply": (_Z_UP, read_ply_mesh),
    ".stl": (replace(_Z_UP, units=("mm", "m", "cm", "in")), read_stl),
    ".off": (_Z_UP, read_off),
    ".dae": (_Y_UP, read_dae),
}


def _declared_by_collada(usual: Declaration, data: bytes) -> Declaration:
    up = re.search(rb"<up_axis>\s*([XYZ])_UP", data)
    meters = re.search(rb"<unit\b[^>]*\bmeter=[\"']([-+.eE\d]+)[\"']", data)
    try:
        length = float(meters[1]) if meters else 0.0
    except ValueError:
        length = 0.0
    return Declaration(
        up[1].decode().lower() if up else usual.up, up is not None, length if length > 0 else None, usual.units
    )


@dataclass(frozen=True)
class MeshFile:
    """A mesh as its file holds it."""

    path: Path
    """Source file."""
    parts: tuple[Part, ...]
    """Its parts, in the file's own axes and unit."""
    declared: Declaration
    """Declared axes and unit."""
    notes: tuple[str, ...]
    """Notes on the file for the user."""


def read_mesh(path: Path) -> MeshFile:
    """Read a mesh file of any of the known endings.

    Raises MeshFileError, in one sentence, for files that are missing, empty, cut off, of another kind than their
    ending, without faces, or in need of files that are missing or elsewhere; MissingExtraError for Collada and
    Draco-compressed glTF without their readers.
    """
    suffix = path.suffix.lower()
    if suffix not in FORMATS:
        raise MeshFileError(f"{path} is no mesh that can be read; these can: {', '.join(SUFFIXES)}")
    try:
        data = path.read_bytes()
    except OSError as error:
        raise MeshFileError(f"the mesh {path} cannot be read: {error.strerror}") from error
    if not data:
        raise MeshFileError(f"{path} is empty")
    require_fetched(path)
    declared, read = FORMATS[suffix]
    beside = FolderResolver(path)
    try:
        parts = read(path, data, beside)
    except DamagedMeshError as error:
        raise MeshFileError(f"{path} {error}") from error
    except (MeshFileError, MissingExtraError):
        raise
    except Exception as error:  # readers of foreign bytes raise whatever they stumble over
        raise MeshFileError(
            f"{path} cannot be read as {suffix[1:]} (cut off, damaged, or another kind of file): {first_line(error)}"
        ) from error
    if not any(len(part.faces) for part in parts):
        raise MeshFileError(f"{path} holds no faces: a mesh needs triangles, points alone are not enough")
    if suffix == ".dae":
        declared = _declared_by_collada(declared, data)
    return MeshFile(path, tuple(parts), declared, tuple(beside.notes))


AnyPath = TypeVar("AnyPath", bound=PurePath)
_SECOND_RATE = (".stl", ".ply")
"""Formats without pictures, which models have beside others for collisions."""


def list_archived_meshes(archive: Path) -> list[str]:
    """Names of the meshes in a .zip that is no capture; none where it cannot be read, which its reader reports."""
    try:
        names = list_names(archive)
    except (CaptureError, OSError):
        return []
    if names_capture(map(PurePosixPath, names)):
        return []
    return [name for name in names if PurePosixPath(name).suffix.lower() in SUFFIXES]


def find_mesh(folder: Path) -> Path | None:
    """The mesh of a folder: the only one in it, or in its meshes/ as Gazebo's models have it; None where none is.

    Folders of several, of formats with pictures, are several places.
    """
    for place in (folder, folder / "meshes"):
        if not place.is_dir():
            continue
        found = [entry for entry in list_folder(place) if entry.suffix.lower() in SUFFIXES and entry.is_file()]
        if found:
            return select_mesh(found)
    return None


def select_mesh(meshes: Sequence[AnyPath]) -> AnyPath | None:
    """The mesh that is meant by several: the only one, else the only one of a format with pictures; None for others."""
    painted = [mesh for mesh in meshes if mesh.suffix.lower() not in _SECOND_RATE]
    best = painted if len(painted) == 1 else meshes
    return best[0] if len(best) == 1 else None


def resolve_mesh(source: Path) -> Path:
    """The mesh that is meant by a file or a folder. Raises MeshFileError where a folder holds none or several."""
    if not source.is_dir():
        return source
    found = find_mesh(source)
    if found is None:
        raise MeshFileError(f"{source} holds no mesh or several of them: name one of its files")
    return found

"""Mesh files: read the units and axes that formats declare, refuse unusable files, and load the others.

A file's own declarations decide where a format leaves them open: glTF is in metres and Y-up, Collada names its unit
and its up axis, the others declare nothing. Files that a mesh names are read from its own folder and nowhere else.

glTF is passed on as a .glb that needs glTF 2.0 alone.
"""

import io
import logging
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath, PurePosixPath
from typing import Any, TypeVar

import trimesh

from nerfnav.core.extras import import_extra
from nerfnav.importers.captures.archive import list_names
from nerfnav.importers.captures.views import CaptureError
from nerfnav.importers.core.errors import MeshFileError, first_line
from nerfnav.importers.core.kinds import MESHES as SUFFIXES
from nerfnav.importers.meshes import gltf
from nerfnav.importers.meshes.gltf_extensions import PlainGltf
from nerfnav.importers.meshes.resolver import FolderResolver


@dataclass(frozen=True)
class Declaration:
    """Declared axes, unit and colour space of a format or a file."""

    up: str
    """Axis that points up: x, y or z."""
    up_is_certain: bool
    """True where the file itself declares it, not only the convention of its format."""
    meters: float | None
    """Length of its unit [m]; None where it is not declared."""
    units: tuple[str, ...]
    """Units to try where none is declared, the likeliest first."""
    linear: bool = False
    """True where plain colours (not textures) are linear light in place of sRGB."""


def gltf_declared(path: Path, data: bytes) -> Declaration:
    header, _ = gltf.parts_of(path, data)
    gltf.require_known(path, header)
    return Declaration("y", False, None, ("m", "cm", "mm"), linear=gltf.is_linear(header))


def _obj(path: Path, data: bytes) -> Declaration:
    if not re.search(rb"^\s*v\s+[-+.\d]", data, re.MULTILINE):
        raise MeshFileError(f"{path} is not an .obj mesh: it has no line that gives a vertex (`v X Y Z`)")
    return Declaration("y", False, None, ("m", "cm", "mm"))


def _ply(path: Path, data: bytes) -> Declaration:
    head, end, _ = data[:65536].partition(b"end_header")
    if not data.startswith(b"ply") or not end:
        raise MeshFileError(f"{path} is not a .ply file: it does not begin with a header of PLY")
    faces = re.search(rb"^element\s+face\s+(\d+)", head, re.MULTILINE)
    if faces is None or int(faces[1]) == 0:
        raise MeshFileError(f"{path} holds no faces: a mesh needs triangles, points alone are not enough")
    return Declaration("z", False, None, ("m", "mm", "cm"))


def _stl(path: Path, data: bytes) -> Declaration:
    triangles = int.from_bytes(data[80:84], "little")
    is_text = data.lstrip()[:5].lower() == b"solid" and b"facet" in data[:4096]
    if len(data) != 84 + 50 * triangles and not is_text:
        raise MeshFileError(
            f"{path} is not a whole .stl file: it has {len(data)} bytes, and its header promises "
            f"{84 + 50 * triangles if len(data) >= 84 else 'at least 84'}"
        )
    if is_text and b"endsolid" not in data:
        raise MeshFileError(f"{path} is cut off: its `endsolid` is missing")
    return Declaration("z", False, None, ("mm", "m", "cm", "in"))


def _dae(path: Path, data: bytes) -> Declaration:
    if b"<COLLADA" not in data:
        raise MeshFileError(f"{path} is not a .dae file: it holds no COLLADA document")
    if b"<!DOCTYPE" in data or b"<!ENTITY" in data:
        raise MeshFileError(f"{path} defines entities of its own, which a mesh has no need of: it is not read")
    up = re.search(rb"<up_axis>\s*([XYZ])_UP", data)
    meters = re.search(rb"<unit\b[^>]*\bmeter=[\"']([-+.eE\d]+)[\"']", data)
    return Declaration(
        up[1].decode().lower() if up else "y",
        up is not None,
        float(meters[1]) if meters and float(meters[1]) > 0 else None,
        ("m", "cm", "mm"),
    )


DECLARATIONS: dict[str, Callable[[Path, bytes], Declaration]] = {
    ".glb": gltf_declared,
    ".gltf": gltf_declared,
    ".obj": _obj,
    ".ply": _ply,
    ".stl": _stl,
    ".dae": _dae,
}


def make_plain_gltf(path: Path, data: bytes, beside: FolderResolver) -> bytes | None:
    """The file as a .glb that needs nothing but glTF 2.0; None where it is that already."""
    header, binary = gltf.parts_of(path, data)

    def read(entry: dict[str, Any]) -> bytes:
        if "uri" not in entry:
            return binary
        inside = gltf.decode_embedded(entry)
        return beside.get(entry["uri"]) if inside is None else inside

    plain = PlainGltf(path, header, read)
    plain.apply()
    gltf.check(path, plain.header, read)
    return plain.packed()


logging.getLogger("trimesh").addHandler(logging.NullHandler())  # what it warns of is checked, and refused, here

_DRACO = b"KHR_draco_mesh_compression"


@dataclass(frozen=True)
class MeshFile:
    """A mesh as its file holds it."""

    path: Path
    """Source file."""
    content: trimesh.Scene
    """Its parts, in the file's own axes and unit."""
    declared: Declaration
    """Declared axes, unit and colour space."""
    notes: tuple[str, ...]
    """Notes on the file for the user."""


def read_mesh(path: Path) -> MeshFile:
    """Read a mesh file of any of the known endings.

    Raises MeshFileError, in one sentence, for files that are missing, empty, cut off, of another kind than their
    ending, without faces, or in need of files that are missing or elsewhere; MissingExtraError for Collada and
    Draco-compressed glTF without their readers.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise MeshFileError(f"{path} is no mesh that can be read; these can: {', '.join(SUFFIXES)}")
    try:
        data = path.read_bytes()
    except OSError as error:
        raise MeshFileError(f"the mesh {path} cannot be read: {error.strerror}") from error
    if not data:
        raise MeshFileError(f"{path} is empty")
    beside = FolderResolver(path)
    declared = DECLARATIONS[suffix](path, data)
    _require_reader(suffix, data)
    plain = make_plain_gltf(path, data, beside) if suffix in (".glb", ".gltf") else None
    file_type, data = (suffix[1:], data) if plain is None else ("glb", plain)
    try:
        content = trimesh.load_scene(io.BytesIO(data), file_type=file_type, resolver=beside, process=False)
    except Exception as error:  # readers of foreign bytes raise whatever they stumble over
        beside.refuse_what_failed()
        raise MeshFileError(
            f"{path} cannot be read as {suffix[1:]} (cut off, damaged, or another kind of file): "
            f"{first_line(error)}"
        ) from error
    beside.refuse_what_failed()
    if not any(isinstance(part, trimesh.Trimesh) and len(part.faces) for part in content.geometry.values()):
        raise MeshFileError(f"{path} holds no faces: a mesh needs triangles, points alone are not enough")
    if _DRACO in data and any(_is_one_point(part) for part in content.geometry.values()):
        raise MeshFileError(f"{path} has a part whose Draco compression cannot be decoded: it is damaged")
    return MeshFile(path, content, declared, tuple(beside.notes))


def _require_reader(suffix: str, data: bytes) -> None:
    """Import what trimesh reads a file with: without it, it gives zeros (Draco) or a long complaint (Collada)."""
    if suffix == ".dae":
        import_extra("collada", "meshes", "a Collada mesh (.dae)")
    elif _DRACO in data:
        import_extra("DracoPy", "meshes", "a mesh with Draco compression")


def _is_one_point(part: object) -> bool:
    """True where all corners are at one point, as trimesh leaves parts that it cannot decode."""
    return isinstance(part, trimesh.Trimesh) and len(part.faces) > 0 and not part.extents.any()


AnyPath = TypeVar("AnyPath", bound=PurePath)
_OF_CAPTURES = ("transforms", "cameras.", "images.", "keyframes", "frame_0", "rgbd", "metadata")
"""Beginnings of file and folder names that only captures have; theirs may hold a mesh too."""
_SECOND_RATE = (".stl", ".ply")
"""Formats without pictures, which models have beside others for collisions."""


def list_archived_meshes(archive: Path) -> list[str]:
    """Names of the meshes in a .zip that is no capture; none where it cannot be read, which its reader reports."""
    try:
        names = [name for name in list_names(archive) if not name.startswith("__MACOSX/")]
    except (CaptureError, OSError):
        return []
    if any(part.startswith(_OF_CAPTURES) for name in names for part in PurePosixPath(name).parts):
        return []
    return [name for name in names if PurePosixPath(name).suffix.lower() in SUFFIXES]


def find_mesh(folder: Path) -> Path | None:
    """The mesh of a folder: the only one in it, or in its meshes/ as Gazebo's models have it; None where none is.

    Folders of several, of formats with pictures, are several places.
    """
    for place in (folder, folder / "meshes"):
        if not place.is_dir():
            continue
        found = [entry for entry in place.iterdir() if entry.suffix.lower() in SUFFIXES and entry.is_file()]
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

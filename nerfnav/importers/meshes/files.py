"""Mesh files: what each format declares of units and axes, what is refused before reading, and reading.

What a file says of itself decides where a format leaves it open: glTF is in metres and Y-up, Collada names its unit
and its up axis, the others say nothing. Files that a mesh names are read from its own folder and nowhere else.

glTF is handed on as a .glb that needs nothing but glTF 2.0.
"""


import io
import logging
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import trimesh

from nerfnav.core.extras import import_extra
from nerfnav.importers.core.errors import MeshFileError, first_sentence
from nerfnav.importers.core.kinds import MESHES as SUFFIXES
from nerfnav.importers.meshes import gltf
from nerfnav.importers.meshes.gltf_extensions import Plain
from nerfnav.importers.meshes.resolver import Beside


@dataclass(frozen=True)
class Declared:
    """What a format or a file says about its own axes and colours."""

    up: str
    """Axis that points up: x, y or z."""
    up_is_certain: bool
    """Whether the file itself says so, not only the habit of its format."""
    meters: float | None
    """Length of its unit [m]; None where nothing is said."""
    units: tuple[str, ...]
    """Units to try where none is declared, the likeliest first."""
    linear: bool = False
    """Whether plain colours (not textures) are linear light in place of sRGB."""


def gltf_declared(path: Path, data: bytes) -> Declared:
    header, _ = gltf_parts(path, data)
    gltf.require_known(path, header)
    return Declared("y", False, None, ("m", "cm", "mm"), linear=gltf.is_linear(header))


def gltf_parts(path: Path, data: bytes) -> tuple[dict[str, Any], bytes]:
    """The header and, of a .glb, the binary chunk."""
    return gltf.glb_parts(path, data) if path.suffix.lower() == ".glb" else (gltf.header_of(path, data), b"")


def _obj(path: Path, data: bytes) -> Declared:
    if not re.search(rb"^\s*v\s+[-+.\d]", data, re.MULTILINE):
        raise MeshFileError(f"{path} is not an .obj mesh: it has no line that gives a vertex (`v X Y Z`)")
    return Declared("y", False, None, ("m", "cm", "mm"))


def _ply(path: Path, data: bytes) -> Declared:
    head, end, _ = data[:65536].partition(b"end_header")
    if not data.startswith(b"ply") or not end:
        raise MeshFileError(f"{path} is not a .ply file: it does not begin with a header of PLY")
    faces = re.search(rb"^element\s+face\s+(\d+)", head, re.MULTILINE)
    if faces is None or int(faces[1]) == 0:
        raise MeshFileError(f"{path} holds no faces: a mesh needs triangles, points alone are not enough")
    return Declared("z", False, None, ("m", "mm", "cm"))


def _stl(path: Path, data: bytes) -> Declared:
    triangles = int.from_bytes(data[80:84], "little")
    is_text = data.lstrip()[:5].lower() == b"solid" and b"facet" in data[:4096]
    if len(data) != 84 + 50 * triangles and not is_text:
        raise MeshFileError(
            f"{path} is not a whole .stl file: it has {len(data)} bytes, and its header promises "
            f"{84 + 50 * triangles if len(data) >= 84 else 'at least 84'}"
        )
    if is_text and b"endsolid" not in data:
        raise MeshFileError(f"{path} is cut off: its `endsolid` is missing")
    return Declared("z", False, None, ("mm", "m", "cm", "in"))


def _dae(path: Path, data: bytes) -> Declared:
    if b"<COLLADA" not in data:
        raise MeshFileError(f"{path} is not a .dae file: it holds no COLLADA document")
    if b"<!DOCTYPE" in data or b"<!ENTITY" in data:
        raise MeshFileError(f"{path} defines entities of its own, which a mesh has no need of: it is not read")
    up = re.search(rb"<up_axis>\s*([XYZ])_UP", data)
    meters = re.search(rb"<unit\b[^>]*\bmeter=[\"']([-+.eE\d]+)[\"']", data)
    return Declared(
        up[1].decode().lower() if up else "y",
        up is not None,
        float(meters[1]) if meters and float(meters[1]) > 0 else None,
        ("m", "cm", "mm"),
    )


LOOKS: dict[str, Callable[[Path, bytes], Declared]] = {
    ".glb": gltf_declared,
    ".gltf": gltf_declared,
    ".obj": _obj,
    ".ply": _ply,
    ".stl": _stl,
    ".dae": _dae,
}


def plain_gltf(path: Path, data: bytes, beside: Beside) -> bytes | None:
    """The file as a .glb that needs nothing but glTF 2.0; None where it is that already."""
    header, binary = gltf_parts(path, data)

    def read(entry: dict[str, Any]) -> bytes:
        if "uri" not in entry:
            return binary
        inside = gltf.embedded(entry)
        return beside.get(entry["uri"]) if inside is None else inside

    plain = Plain(path, header, read)
    plain.apply()
    gltf.check(path, plain.header, read)
    return plain.packed()


logging.getLogger("trimesh").addHandler(logging.NullHandler())  # what it warns of is checked, and refused, here

_DRACO = b"KHR_draco_mesh_compression"


@dataclass(frozen=True)
class MeshFile:
    """A mesh as its file holds it."""

    path: Path
    """Where it was read from."""
    content: trimesh.Scene
    """Its parts, in the file's own axes and unit."""
    declared: Declared
    """What is known of these."""
    notes: tuple[str, ...]
    """What a user should know about the file."""


def read_mesh(path: Path) -> MeshFile:
    """Read a mesh file of any of the known endings.

    Raises MeshFileError, in one sentence, for files that are missing, empty, cut off, of another kind than their
    ending says, without faces, or in need of files that are missing or lie elsewhere; MissingExtraError for Collada and
    Draco-compressed glTF where what reads them is not installed.
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
    beside = Beside(path)
    declared = LOOKS[suffix](path, data)
    _require_reader(suffix, data)
    plain = plain_gltf(path, data, beside) if suffix in (".glb", ".gltf") else None
    file_type, data = (suffix[1:], data) if plain is None else ("glb", plain)
    try:
        content = trimesh.load_scene(io.BytesIO(data), file_type=file_type, resolver=beside, process=False)
    except Exception as error:  # readers of foreign bytes raise whatever they stumble over
        beside.refuse_what_failed()
        raise MeshFileError(
            f"{path} cannot be read as {suffix[1:]} (cut off, damaged, or another kind of file): "
            f"{first_sentence(error)}"
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
    """Whether all corners lie in one place, as trimesh leaves those that it cannot decode."""
    return isinstance(part, trimesh.Trimesh) and len(part.faces) > 0 and not part.extents.any()

"""What mesh formats and their files declare of themselves, and what is refused before it is read."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from nerfnav.importers.meshes import gltf
from nerfnav.importers.meshes.refusal import MeshFileError


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

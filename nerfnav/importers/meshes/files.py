"""Mesh files: what each format promises, what is refused before it is read, and reading.

What a file says of itself decides where a format leaves it open: glTF is in metres and Y-up, Collada names its unit and
its up axis, the others say nothing. Files that a mesh names are read from its own folder and nowhere else.
"""

import io
import logging
from dataclasses import dataclass
from pathlib import Path

import trimesh

from nerfnav.core.extras import from_extra
from nerfnav.importers.core.kinds import MESHES as SUFFIXES
from nerfnav.importers.meshes.beside import Beside
from nerfnav.importers.meshes.declared import LOOKS, Declared
from nerfnav.importers.meshes.gltf_file import plain_gltf
from nerfnav.importers.meshes.refusal import MeshFileError, first_sentence

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
        from_extra("collada", "meshes", "a Collada mesh (.dae)")
    elif _DRACO in data:
        from_extra("DracoPy", "meshes", "a mesh with Draco compression")


def _is_one_point(part: object) -> bool:
    """Whether all corners lie in one place, as trimesh leaves those that it cannot decode."""
    return isinstance(part, trimesh.Trimesh) and len(part.faces) > 0 and not part.extents.any()

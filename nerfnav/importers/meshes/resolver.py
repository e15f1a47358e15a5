"""Resolver of the files that a mesh names: textures, materials and buffers.

Only files in the mesh's own folder are read or, for a mesh in meshes/ of a Gazebo model (model.config, meshes/ and,
beside these, materials/textures/ or textures/), in the model's folder.
"""

import io
import urllib.parse
from collections.abc import Iterator
from pathlib import Path

from PIL import Image
from trimesh.resolvers import Resolver

from nerfnav.importers.core.errors import MeshFileError


def root_of(mesh: Path) -> Path:
    """The folder in which files may lie that a mesh names: its own, or the model's where that is its meshes/."""
    folder = mesh.resolve().parent
    model = folder.parent
    is_model = folder.name.lower() == "meshes" and (
        (model / "materials").is_dir() or (model / "model.config").is_file() or (model / "textures").is_dir()
    )
    return model if is_model else folder


_TEXTURES = ("materials/textures", "textures", "materials/scripts", "meshes")
_PICTURES = {".png", ".jpg", ".jpeg", ".bmp", ".tga", ".tif", ".tiff", ".webp", ".gif", ".dds"}


class FolderResolver(Resolver):
    """Reads what lies beside a mesh, and remembers what it could not: readers of meshes go on without it, unheard."""

    def __init__(self, mesh: Path) -> None:
        """Read from the folder of `mesh` and the folders in it, or of the model that it belongs to."""
        self._mesh = mesh
        self._folder = mesh.resolve().parent
        self._root = root_of(mesh)
        self._failed: list[str] = []
        self.notes: list[str] = []

    def get(self, key: str) -> bytes:
        """The bytes of a file that the mesh names. Raises MeshFileError where it is missing or lies elsewhere."""
        name = urllib.parse.unquote(key).strip().replace("\\", "/").removeprefix("file://").removeprefix("./")
        path = self._found(name)
        suffix = path.suffix.lower()
        if not path.is_relative_to(self._root):
            raise self._failure(f"names the file {name}, which lies outside its own folder: it is not read")
        if not path.is_file():
            if suffix not in (".mtl", *_PICTURES):
                raise self._failure(f"needs the file {name}, which is not beside it")
            note = f"its texture {name} is missing, so what it covers is grey"
            if suffix == ".mtl":  # without it there are no colours, but all of the shape
                note = f"its materials {name} are missing, so it is grey"
            if note not in self.notes:
                self.notes.append(note)
            raise FileNotFoundError(name)
        data = path.read_bytes()
        if suffix in _PICTURES:
            try:
                Image.open(io.BytesIO(data)).verify()
            except Exception as error:  # whatever a picture of unknown origin makes its reader raise
                raise self._failure(f"needs the texture {name}, which is no picture that can be read") from error
        return data

    def refuse_what_failed(self) -> None:
        """Raise MeshFileError for the first file that could not be had."""
        if self._failed:
            raise MeshFileError(self._failed[0])

    def keys(self) -> Iterator[str]:
        """Names of all files that can be read."""
        return (str(path.relative_to(self._folder)) for path in self._folder.rglob("*") if path.is_file())

    def write(self, name: str, data: object) -> None:
        """Nothing is ever written beside a mesh."""
        raise MeshFileError(f"{self._mesh}: nothing is written beside a mesh")

    def namespaced(self, namespace: str) -> "FolderResolver":
        """The same: folders are part of names."""
        return self

    def _found(self, name: str) -> Path:
        """Path of a file: as its name is written, else, by its last part, in the model's folders of textures."""
        path = (self._folder / name).resolve()
        last = Path(name).name
        others = (self._root / folder / last for folder in _TEXTURES) if self._root != self._folder else ()
        return path if path.is_file() else next((other.resolve() for other in others if other.is_file()), path)

    def _failure(self, what: str) -> MeshFileError:
        self._failed.append(f"{self._mesh} {what}")
        return MeshFileError(self._failed[-1])

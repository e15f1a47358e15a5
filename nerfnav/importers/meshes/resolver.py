"""Resolver of the files that a mesh names: textures, materials and buffers.

Only files in the mesh's own folder are read or, for a mesh in meshes/ of a Gazebo model (model.config, meshes/ and,
beside these, materials/textures/ or textures/), in the model's folder. Textures that are missing or no pictures make
grey, and a note; a missing buffer is an error.
"""

import io
import os
import urllib.parse
from pathlib import Path

import numpy as np
from PIL import Image

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.files import require_fetched
from nerfnav.importers.core.kinds import identify_data
from nerfnav.importers.meshes.parts import DamagedMeshError
from nerfnav.world.surface import Image as Pixels


def root_of(mesh: Path) -> Path:
    """The folder in which files may lie that a mesh names: its own, or the model's where that is its meshes/."""
    folder = mesh.resolve().parent
    model = folder.parent
    is_model = folder.name.lower() == "meshes" and (
        (model / "materials").is_dir() or (model / "model.config").is_file() or (model / "textures").is_dir()
    )
    return model if is_model else folder


_TEXTURES = ("materials/textures", "textures", "materials/scripts", "meshes")
_PICTURES = {".png", ".jpg", ".jpeg", ".bmp", ".tga", ".tif", ".tiff", ".webp", ".gif", ".dds", ".avif", ".ktx2"}


class PictureError(DamagedMeshError):
    """A texture that cannot be had: what it covers is grey."""

    def __init__(self, name: str, why: str) -> None:
        """Say why the texture `name` is not shown."""
        super().__init__(f"its texture {name} {why}, so what it covers is grey")


def decode_picture(data: bytes, name: str) -> Pixels:
    """The sRGB pixels of a picture. Raises PictureError where it is none that can be read."""
    try:
        return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"), np.uint8)
    except Exception as error:  # whatever a picture of unknown origin makes its reader raise
        kind = identify_data(data[:64])
        named = f" ({kind})" if kind else ""
        raise PictureError(name, f"is no picture that can be read{named}") from error


class FolderResolver:
    """Reads what lies beside a mesh, and collects notes for the user."""

    def __init__(self, mesh: Path) -> None:
        """Read from the folder of `mesh` and the folders in it, or of the model that it belongs to."""
        self._folder = mesh.resolve().parent
        self._root = root_of(mesh)
        self.notes: list[str] = []

    def get(self, key: str) -> bytes:
        """The bytes of a buffer or of materials. Raises MeshFileError where the file is missing or lies elsewhere."""
        name = _name_of(key)
        path = self._found(name)
        if not path.is_relative_to(self._root):
            raise DamagedMeshError(f"names the file {name}, which lies outside its own folder: it is not read")
        if not os.path.isfile(path):  # unlike Path.is_file it takes any name
            raise DamagedMeshError(f"needs the file {name}, which is not beside it")
        return _bytes(path)

    def picture(self, key: str) -> Pixels:
        """The sRGB pixels of a texture that the mesh names. Raises PictureError where it cannot be had."""
        name = _name_of(key)
        path = self._found(name)
        if not path.is_relative_to(self._root):
            raise PictureError(name, "lies outside its own folder and is not read")
        if not os.path.isfile(path):
            raise PictureError(name, "is missing")
        return decode_picture(_bytes(path), name)

    def note(self, sentence: str) -> None:
        """Keep a sentence for the user, once."""
        if sentence not in self.notes:
            self.notes.append(sentence)

    def _found(self, name: str) -> Path:
        """Path of a file: as its name is written, in any case; a texture's also by its last part, in other folders.

        Programs write the whole path that a texture has on their own machine.
        """
        path = (self._folder / name).resolve()
        last = Path(name).name
        folders = [path.parent]
        if path.suffix.lower() in _PICTURES or self._root != self._folder:
            folders.append(self._folder)
        if self._root != self._folder:
            folders += [self._root / folder for folder in _TEXTURES]
        for folder in folders:
            if folder.resolve().is_relative_to(self._root) and folder.is_dir():
                exact = folder / last
                alike = (entry for entry in sorted(folder.iterdir()) if entry.name.lower() == last.lower())
                found = exact if os.path.isfile(exact) else next(alike, None)
                if found is not None and found.is_file():
                    return found.resolve()
        return path


def _bytes(path: Path) -> bytes:
    try:
        require_fetched(path)
        return path.read_bytes()
    except InvalidInputError as error:
        raise DamagedMeshError(f"needs a file that is not there: {error}") from error
    except OSError as error:
        raise DamagedMeshError(f"names the file {path.name}, which cannot be read: {error.strerror}") from error


def _name_of(key: str) -> str:
    """The name of a file by a URI or by a path of any system, relative to the mesh."""
    name = urllib.parse.unquote(key).encode("utf-8", "replace").decode().replace("\0", "").strip().replace("\\", "/")
    return name.removeprefix("file://").removeprefix("./")

"""Unpack sources that came in an archive, for as long as they are read."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath

from nerfnav.core.errors import InvalidInputError
from nerfnav.importers import (
    CaptureError,
    MeshFileError,
)
from nerfnav.importers.captures.archive import extract, unpack_capture
from nerfnav.importers.core.kinds import ARCHIVES, VIDEOS
from nerfnav.importers.meshes.files import SUFFIXES, list_archived_meshes, resolve_mesh, select_mesh

_BESIDE = (".mtl", ".bin", ".png", ".jpg", ".jpeg", ".webp", ".bmp", ".tga", ".tif", ".tiff")
"""Endings of the files that meshes in an archive may need."""


@contextmanager
def mesh_unpacked(source: Path) -> Iterator[Path]:
    """The mesh file, unpacked where it came in an archive."""
    if source.suffix.lower() != ".zip":
        yield resolve_mesh(source)
        return
    names = list_archived_meshes(source)
    name = select_mesh([PurePosixPath(name) for name in names])
    if name is None:
        raise InvalidInputError(f"{source} holds {len(names)} meshes ({', '.join(names[:5])}): pack one alone")
    with tempfile.TemporaryDirectory(prefix="nerfnav-", ignore_cleanup_errors=True) as folder:
        extract(source, Path(folder), (*SUFFIXES, *_BESIDE))
        try:
            yield Path(folder) / name
        except MeshFileError as error:
            # people know the archive, not the folder that it was unpacked into
            raise MeshFileError(str(error).replace(folder + os.sep, "")) from error


@contextmanager
def capture_unpacked(source: Path) -> Iterator[tuple[Path, Path | None]]:
    """The capture, and the folder that it may not read beyond: one that came as a file may come from anybody."""
    suffix = source.suffix.lower()
    if suffix not in (*ARCHIVES, *VIDEOS):
        yield source, None
        return
    with tempfile.TemporaryDirectory(prefix="nerfnav-", ignore_cleanup_errors=True) as folder:
        try:
            yield unpack_capture(source, Path(folder)) if suffix in ARCHIVES else Path(folder), Path(folder)
        except CaptureError as error:
            # people know the archive, not the folder that it was unpacked into
            raise CaptureError(str(error).replace(folder + os.sep, "").replace(folder, str(source))) from error

"""Folders and archives of splats: find the file that is meant, and unpack it.

Training of 3D Gaussian splatting leaves point_cloud/iteration_N/point_cloud.ply, beside points and cameras that are no
splats; the last iteration counts. Elsewhere a folder or archive holds one file of splats, or the parts of a SOG.
"""

import os
import re
import tempfile
import zipfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path, PurePath, PurePosixPath
from typing import TypeVar

from nerfnav.core.errors import InvalidInputError
from nerfnav.formats import is_system_file
from nerfnav.importers.captures.archive import BROKEN, extract, files_in
from nerfnav.importers.core.kinds import ARCHIVES, OWN_SPLATS, SPLATS, names_capture
from nerfnav.importers.core.ply_header import LONGEST_HEADER
from nerfnav.importers.splats.ply import is_splat_header
from nerfnav.importers.splats.sog import META, is_sog, is_sog_meta

AnyPath = TypeVar("AnyPath", bound=PurePath)
_ITERATION = re.compile(r"iteration_(\d+)")
_PARTS = (*SPLATS, ".json", ".webp")
"""Endings of what is unpacked."""
_NESTED = ("*", "iteration_*/*", "point_cloud/iteration_*/*")
"""Places in a folder where its splats may lie."""


def is_container(source: Path) -> bool:
    """True for a folder that is no SOG, and for an archive."""
    return source.suffix.lower() in ARCHIVES if source.is_file() else source.is_dir() and not is_sog(source / META)


def list_splats(container: Path) -> Sequence[PurePath]:
    """Files of splats in a folder, or an archive that is no capture: names of those of the last iteration, else all.

    An archive that cannot be read holds none; its reader reports it.
    """
    if container.is_dir():
        found = [path for pattern in _NESTED for path in container.glob(pattern) if path.is_file()]
        return _chosen([path.relative_to(container) for path in found], lambda name: _is_splats(container / name))
    try:
        with zipfile.ZipFile(container) as archive:
            entries = {PurePosixPath(entry.filename): entry for entry in files_in(archive)}
            chosen = _chosen(entries, lambda name: _is_splats_inside(archive, entries[name]))
            trained = any(_iteration(name) >= 0 for name in chosen)
            return chosen if trained or not names_capture(entries) else []
    except (*BROKEN, OSError):
        return []


def splats_file(source: Path) -> PurePath:
    """Name of the file of splats that a source is, or holds; the source itself where it holds none, or several."""
    names = list_splats(source) if is_container(source) else []
    return names[0] if len(names) == 1 else source


@contextmanager
def unpack_splats(container: Path) -> Iterator[Path]:
    """Give the file of splats of a folder or an archive, for as long as it is read.

    Raises InvalidInputError where there is none, or several of which none is meant.
    """
    names = list_splats(container)
    if len(names) != 1:
        listed = f" ({', '.join(str(name) for name in names[:5])})" if names else ""
        raise InvalidInputError(f"{container} holds {len(names)} files of splats{listed}, and one is needed: name it")
    if container.is_dir():
        yield container / names[0]
        return
    with tempfile.TemporaryDirectory(prefix="nerfnav-", ignore_cleanup_errors=True) as folder:
        try:
            extract(container, Path(folder), _PARTS)
            yield Path(folder) / names[0]
        except InvalidInputError as error:
            # the user knows the archive, not the folder that it was unpacked into
            raise type(error)(str(error).replace(folder + os.sep, f"{container}: ")) from error


def _chosen(names: Iterable[AnyPath], is_splats: Callable[[AnyPath], bool]) -> list[AnyPath]:
    names = [name for name in names if name.suffix.lower() in _PARTS and not is_system_file(name.as_posix())]
    found = sorted(name for name in names if is_splats(name))
    last = max(map(_iteration, found), default=-1)
    return [name for name in found if _iteration(name) == last]


def _iteration(name: PurePath) -> int:
    """Number of the iteration that a file's folder names; -1 where it names none."""
    numbered = _ITERATION.fullmatch(name.parent.name)
    return int(numbered[1]) if numbered else -1


def _is_splats(path: Path) -> bool:
    suffix = path.suffix.lower()
    if suffix == ".json":
        return path.name.lower() == META and is_sog(path)
    if suffix == ".ply":
        return is_splat_header(path)
    return suffix in SPLATS and not path.name.lower().endswith(OWN_SPLATS)


def _is_splats_inside(archive: zipfile.ZipFile, entry: zipfile.ZipInfo) -> bool:
    name = PurePosixPath(entry.filename)
    suffix = name.suffix.lower()
    if suffix not in (".json", ".ply"):
        return suffix in SPLATS
    if suffix == ".json" and name.name.lower() != META:
        return False
    with archive.open(entry) as stream:
        head = stream.read(LONGEST_HEADER)
    return is_splat_header(head) if suffix == ".ply" else is_sog_meta(head)

"""Atomic file writes: write beside the target and rename, so that no failure leaves half a file or harms the old.

Before a file is read, `require_fetched` tells a pointer of Git LFS, which any ending may have, from the file itself.
Also the one reader of npz files, which nerfnav writes for all that has arrays.
"""

import json
import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from nerfnav.core.errors import InvalidInputError

LFS_POINTER = b"version https://git-lfs"
"""Beginning of the small text that Git leaves in place of a large file."""
NOT_FETCHED = "a pointer of Git LFS in place of the file itself (fetch it with `git lfs pull`)"


def require_fetched(path: Path) -> None:
    """Raise InvalidInputError where a file is a pointer of Git LFS; what cannot be read is left to its reader."""
    try:
        with path.open("rb") as file:
            is_pointer = file.read(len(LFS_POINTER)) == LFS_POINTER
    except OSError:
        return
    if is_pointer:
        raise InvalidInputError(f"{path} is {NOT_FETCHED}")


@contextmanager
def replace_file(path: Path) -> Iterator[BinaryIO]:
    """A stream to write to, which takes the place of the file `path` once the block ends well; else nothing changes.

    Raises OSError where the file cannot be written or put into its place.
    """
    # hidden, and each process has its own: no reader takes half a file for a whole one, and two writers do not mix
    beside = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with beside.open("wb") as stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        beside.replace(path)
    except BaseException:
        beside.unlink(missing_ok=True)
        raise


def write_npz(path: Path, arrays: Mapping[str, np.ndarray]) -> int:
    """Write named arrays to `path` as a compressed npz, in the way of `replace_file`; returns its size in bytes."""
    with replace_file(path) as stream:
        np.savez_compressed(stream, **dict(arrays))  # type: ignore[arg-type] # none is called allow_pickle
    return path.stat().st_size


_LAST = sys.maxunicode
"""Largest code point of a character."""


class DamagedNpzError(ValueError):
    """An npz file, or an array in one, that cannot be read: the message is the end of a sentence on the file."""


class NpzArrays(Mapping[str, np.ndarray]):
    """Arrays of an open npz file, each read when it is asked for; objects are refused."""

    def __init__(self, file: np.lib.npyio.NpzFile) -> None:
        """Read from `file`, which `open_npz` closes."""
        self._file = file

    def __getitem__(self, name: str) -> np.ndarray:
        """Array of that name. Raises DamagedNpzError where it is missing or cannot be read."""
        if name not in self._file.files:
            raise DamagedNpzError(f"it has no array {name!r}")
        try:
            array = self._file[name]
        except Exception as error:  # zip, its compression and numpy's header each raise their own for damage
            raise DamagedNpzError(f"its array {name!r} is damaged") from error
        if not isinstance(array, np.ndarray):
            raise DamagedNpzError(f"its entry {name!r} is no array")
        if array.dtype.kind == "U" and np.ascontiguousarray(array).reshape(-1).view(np.uint32).max(initial=0) > _LAST:
            raise DamagedNpzError(f"the text of its array {name!r} is damaged")
        return array

    def __contains__(self, name: object) -> bool:
        """Check for an array without reading it."""
        return name in self._file.files

    def __iter__(self) -> Iterator[str]:
        """Names of the arrays."""
        return iter(self._file.files)

    def __len__(self) -> int:
        """Number of arrays."""
        return len(self._file.files)

    @property
    def size(self) -> int:
        """Size of all arrays as they unpack [bytes]."""
        return 0 if self._file.zip is None else sum(part.file_size for part in self._file.zip.infolist())

    @property
    def header(self) -> dict[str, Any]:
        """JSON object in the array `header`. Raises DamagedNpzError where there is none."""
        array = self["header"]
        try:
            header = json.loads(array.item())
        except (ValueError, TypeError, RecursionError) as error:
            raise DamagedNpzError("its header is no JSON") from error
        if not isinstance(header, dict):
            raise DamagedNpzError("its header is no JSON object")
        return header


@contextmanager
def open_npz(path: Path) -> Iterator[NpzArrays]:
    """Open an npz file to read its arrays. Raises OSError where it cannot be read, DamagedNpzError where it is none."""
    try:
        file = np.load(path, allow_pickle=False)
    except OSError:
        raise
    except Exception as error:  # numpy raises anything for foreign data
        raise DamagedNpzError("it is cut off, or no npz file") from error
    if not isinstance(file, np.lib.npyio.NpzFile):
        raise DamagedNpzError("it holds one array, not several by name")
    with file:
        yield NpzArrays(file)

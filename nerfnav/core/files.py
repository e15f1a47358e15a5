"""Atomic file writes: write beside the target and rename, so that no failure leaves half a file or harms the old.

Before a file is read, `require_fetched` tells a pointer of Git LFS, which any ending may have, from the file itself.
"""

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

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

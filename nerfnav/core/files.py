"""Atomic file writes: write beside the target and rename, so that no failure leaves half a file or harms the old."""

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

import numpy as np


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

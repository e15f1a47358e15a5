"""Cache of compiled kernels, which knows when it is stale.

numba caches compiled functions by the time stamp of the file they stand in, and misses changes in files they call
into: stale machine code then gives silently wrong results. The cache folder is therefore named after the content
of all kernel sources.
"""

import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

from platformdirs import user_cache_path

_PACKAGE = Path(__file__).parent


@cache
def _sources_digest() -> str:
    import numba

    digest = hashlib.sha256(numba.__version__.encode())
    for path in sorted(_PACKAGE.rglob("kernels/*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def cache_folder() -> Path:
    """Where compiled kernels are kept: in NUMBA_CACHE_DIR or the user's cache, a folder for each state of them."""
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    root = Path(chosen) / "nerfnav" if chosen else user_cache_path("nerfnav", appauthor=False)
    return root / f"kernels-{_sources_digest()}"


@contextmanager
def caching() -> Iterator[None]:
    """Let numba keep there what it compiles inside the block; the folder is set for the whole process."""
    from numba import config

    before = config.CACHE_DIR  # type: ignore[attr-defined]
    config.CACHE_DIR = str(cache_folder())  # type: ignore[attr-defined]
    try:
        yield
    finally:
        config.CACHE_DIR = before  # type: ignore[attr-defined]

"""Cache of compiled kernels, which knows when it is stale.

numba caches compiled functions by the time stamp of the file they stand in, and misses changes in files they call
into: stale machine code then gives silently wrong results. The cache folder is therefore named after the content
of all kernel sources, and shared by all installations that have the same.
"""

import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

from platformdirs import user_cache_path

_PACKAGE = Path(__file__).parents[1]
_LOCATORS = "nerfnav.core.kernel_locator.KernelLocator,UserProvidedCacheLocator"
"""Where numba looks for a kernel's machine code, the first that takes it; before version 0.62, elsewhere."""


@cache
def _sources_digest() -> str:
    import numba

    digest = hashlib.sha256(numba.__version__.encode())
    compilation = _PACKAGE / "core/jit.py"  # how they are compiled
    for path in (compilation, *sorted(_PACKAGE.rglob("kernels/*.py"))):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def cache_folder() -> Path:
    """Where compiled kernels are kept: in NUMBA_CACHE_DIR or the user's cache, a folder for each state of them."""
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    root = Path(chosen) / "nerfnav" if chosen else user_cache_path("nerfnav", appauthor=False)
    return root / f"kernels-{_sources_digest()}"


@contextmanager
def caching(folder: Path) -> Iterator[None]:
    """Let numba keep in a folder what it compiles inside the block; the folder is set for the whole process."""
    from numba import config

    wanted = {"CACHE_DIR": str(folder), "CACHE_LOCATOR_CLASSES": _LOCATORS}
    before = {name: getattr(config, name, "") for name in wanted}
    try:
        for name, value in wanted.items():
            setattr(config, name, value)
        yield
    finally:
        for name, value in before.items():
            setattr(config, name, value)

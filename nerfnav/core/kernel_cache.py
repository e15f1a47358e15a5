"""Kernel cache: machine code of kernels, in a folder that is named after the source of all of them.

numba caches compiled functions by the time stamp of the file they stand in, and misses changes in files they call
into: stale machine code then gives silently wrong results. The name of the cache folder is therefore a digest of every
file of the package that holds a kernel, wherever it stands, of the files whose constants kernels compile in, and of
nerfnav/core/jit.py. All installations with the same kernels share it.
"""

import hashlib
import os
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path

from nerfnav.core.cache import cache_root
from nerfnav.core.errors import InvalidInputError

PACKAGE = Path(__file__).parents[1]
_KERNEL = re.compile(rb"^[ \t]*@(?:\w+\.)*kernel\(", re.MULTILINE)
_CAPITALS = rb"\b[A-Z][A-Z_]+\b"
_CONSTANTS = re.compile(
    rb"^from nerfnav\.([\w.]+) import (?:\([^)]*?" + _CAPITALS + rb"|[^(\n]*" + _CAPITALS + rb")", re.MULTILINE
)
"""Imports of names in capitals: numba compiles the values of constants in."""
_LOCATORS = "nerfnav.core.kernel_locator.KernelLocator,UserProvidedCacheLocator"
"""Locators that numba asks for the folder of a kernel's machine code, in this order, from version 0.62 on."""


class KernelCacheWarning(UserWarning):
    """Machine code of kernels cannot be kept."""


@cache
def kernel_files(package: Path = PACKAGE) -> frozenset[Path]:
    """Find the files of a package that hold a kernel: those with a line that begins with `@kernel(`."""
    return frozenset(path for path in package.rglob("*.py") if _KERNEL.search(path.read_bytes()))


def sources_digest(package: Path = PACKAGE) -> str:
    """Digest of numba's version and of every source that the machine code of a package's kernels depends on."""
    found = kernel_files(package)
    imported = {name.decode() for path in found for name in _CONSTANTS.findall(path.read_bytes())}
    constants = {package.joinpath(*name.split(".")).with_suffix(".py") for name in imported}
    digest = hashlib.sha256(version("numba").encode())
    for path in sorted({package / "core/jit.py", *found, *filter(Path.is_file, constants)}):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


_own_digest = cache(sources_digest)


def require_covered(name: str, file: str) -> None:
    """Raise InvalidInputError for a kernel of nerfnav in a file that the name of the cache folder does not cover."""
    path = Path(file)
    if path.is_relative_to(PACKAGE) and path not in kernel_files():
        raise InvalidInputError(
            f"the kernel {name} stands in {path.relative_to(PACKAGE.parent)}, which the key of the kernel cache does "
            "not cover: put @kernel(...) on a line of its own above the function"
        )


def cache_folder() -> Path:
    """Folder of compiled kernels, in NUMBA_CACHE_DIR or the user's cache: one for each state of their sources."""
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    root = Path(chosen) / "nerfnav" if chosen else cache_root()
    return root / f"kernels-{_own_digest()}"


def complete_mark() -> Path:
    """File in the cache folder that stands there once all kernels of plans and flights have been compiled."""
    return cache_folder() / "complete"


def can_be_kept() -> bool:
    """Check that machine code can be written to the cache folder, which is made; warns once where it cannot."""
    return _can_be_written(cache_folder())


@cache
def _can_be_written(folder: Path) -> bool:
    with suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
    if folder.is_dir() and os.access(folder, os.W_OK):
        return True
    remedy = "set NUMBA_CACHE_DIR to a folder that can be written"
    warnings.warn(f"{folder} cannot be written: each start compiles kernels anew; {remedy}", KernelCacheWarning, 2)
    return False


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

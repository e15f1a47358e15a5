"""How kernels are compiled: one decorator, one cache that knows when it is stale, one way to say how many threads.

numba caches compiled functions by the time stamp of the file they stand in, and misses changes in files they call
into: stale machine code then gives silently wrong results. The cache folder is therefore named after the content
of all kernel sources.
"""

import hashlib
import inspect
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numba
import torch

_PACKAGE = Path(__file__).parent


def _sources_digest() -> str:
    digest = hashlib.sha256(numba.__version__.encode())
    for path in sorted(_PACKAGE.rglob("kernels/*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def cache_folder() -> Path:
    """Where compiled kernels are kept: in NUMBA_CACHE_DIR or the user's cache, a folder for each state of them."""
    root = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(root) / "nerfnav" / f"kernels-{_sources_digest()}"


@contextmanager
def _cache_in(folder: Path) -> Iterator[None]:
    before = numba.config.CACHE_DIR  # type: ignore[attr-defined]
    numba.config.CACHE_DIR = str(folder)  # type: ignore[attr-defined]
    try:
        yield
    finally:
        numba.config.CACHE_DIR = before  # type: ignore[attr-defined]


_FOLDER = cache_folder()
_FAST = {"nsz", "arcp", "contract", "afn", "reassoc"}  # all but nnan and ninf: NaN must stay visible


def kernel(*, parallel: bool = False, inline: bool = False) -> Callable[[Any], Any]:
    """Compile a function with numba, cached, without the interpreter's lock.

    `inline` marks a small function that is only called by other kernels.
    """

    def decorate(function: Any) -> Any:
        options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "fastmath": _FAST, "cache": True}
        if inline:
            options |= {"cache": False, "forceinline": True}
        with _cache_in(_FOLDER):
            # unwrapped: when shapes are checked, every function of the package comes in a wrapper
            return numba.njit(parallel=parallel, **options)(inspect.unwrap(function))

    return decorate


def default_threads() -> int:
    """All cores that this process may use but one, which is left to the web server and the rest; at least 1."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 2
    return max(1, cores - 1)


@contextmanager
def threads(count: int) -> Iterator[int]:
    """Let kernels inside the block use at most `count` threads; yields how many they really use.

    Both numba and torch run on OpenMP, and a parallel kernel leaves torch with all cores, on which its small tensors
    are ten times slower beside another busy process: torch gets back the number that it had.
    """
    used = max(1, min(count, numba.config.NUMBA_NUM_THREADS))  # type: ignore[attr-defined]
    # torch first: the first question to numba starts its threads, and torch then answers with their number
    torch_before, before = torch.get_num_threads(), numba.get_num_threads()
    numba.set_num_threads(used)
    try:
        yield used
    finally:
        numba.set_num_threads(before)
        torch.set_num_threads(torch_before)

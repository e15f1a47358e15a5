"""Disk cache: files in the user's cache folder, each under a key that covers everything it was made from.

Caches in memory are `functools.lru_cache` on functions and `cached_property` on frozen records; what must outlive a
process is kept here.
"""

import contextlib
import hashlib
from collections.abc import Callable
from pathlib import Path

from platformdirs import user_cache_path

from nerfnav.core.files import replace_file

_MOST_OF_A_KIND = 12


def cache_root() -> Path:
    """Folder of all that nerfnav can make again, in the user's cache folder."""
    return user_cache_path("nerfnav", appauthor=False)


def load_or_make(kind: str, key: bytes, make: Callable[[], bytes]) -> bytes:
    """Return the file of a `key`, made by `make` where there is none; the latest dozen of a kind are kept.

    `key` must cover everything that the result depends on, the code that makes it included. A cache that cannot be
    read or written only costs time.
    """
    before = load(kind, key)
    return store(kind, key, make()) if before is None else before


def store(kind: str, key: bytes, made: bytes) -> bytes:
    """Store what was made for this `key`, remove the oldest files of its kind, and return it."""
    with contextlib.suppress(OSError):
        path = _path(kind, key)
        path.parent.mkdir(parents=True, exist_ok=True)
        with replace_file(path) as stream:
            stream.write(hashlib.sha256(made).digest() + made)
        for old in sorted(path.parent.iterdir(), key=lambda entry: entry.stat().st_mtime)[:-_MOST_OF_A_KIND]:
            old.unlink()
    return made


def load(kind: str, key: bytes) -> bytes | None:
    """Load what was stored for this `key`; None where there is nothing, or nothing whole."""
    with contextlib.suppress(OSError):
        content = _path(kind, key).read_bytes()
        # a digest goes first: a file that was torn or tampered with is made again
        if hashlib.sha256(content[32:]).digest() == content[:32]:
            return content[32:]
    return None


def hash_code(*paths: Path) -> bytes:
    """Digest of Python files, and of all those in folders, deeply."""
    digest = hashlib.sha256()
    for file in sorted(file for path in paths for file in (path.rglob("*.py") if path.is_dir() else [path])):
        digest.update(file.read_bytes())
    return digest.digest()


def _path(kind: str, key: bytes) -> Path:
    return cache_root() / kind / hashlib.sha256(key).hexdigest()[:32]

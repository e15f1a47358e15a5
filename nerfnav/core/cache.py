"""Disk cache: keep in the user's cache folder what takes seconds to make and always comes out the same."""

import contextlib
import hashlib
from collections.abc import Callable
from pathlib import Path

from platformdirs import user_cache_path

from nerfnav.core.files import replace_file

_MOST_OF_A_KIND = 12


def cache_root() -> Path:
    """Where nerfnav keeps what it can make again: in the user's cache folder."""
    return user_cache_path("nerfnav", appauthor=False)


def load_or_make(kind: str, key: bytes, make: Callable[[], bytes]) -> bytes:
    """What `make` gives, from the cache if it was ever made for this `key`; the latest dozen of a kind are kept.

    `key` must hold everything that the result depends on, the code that makes it included. A cache that cannot be
    read or written only costs time.
    """
    before = found(kind, key)
    return keep(kind, key, make()) if before is None else before


def keep(kind: str, key: bytes, made: bytes) -> bytes:
    """Keep what was made for this `key`, and give it back."""
    with contextlib.suppress(OSError):
        _write(_path(kind, key), hashlib.sha256(made).digest() + made)
    return made


def found(kind: str, key: bytes) -> bytes | None:
    """What was kept for this `key`; None where there is nothing, or nothing whole."""
    with contextlib.suppress(OSError):
        content = _path(kind, key).read_bytes()
        # a digest goes first: a file that was torn or tampered with is made again
        if hashlib.sha256(content[32:]).digest() == content[:32]:
            return content[32:]
    return None


def code_of(*folders: Path) -> bytes:
    """A digest of all Python files in `folders`, deeply."""
    digest = hashlib.sha256()
    for path in sorted(path for folder in folders for path in folder.rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.digest()


def _path(kind: str, key: bytes) -> Path:
    return cache_root() / kind / hashlib.sha256(key).hexdigest()[:32]


def _write(path: Path, content: bytes) -> None:
    """Write a file, and forget the oldest of its kind."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with replace_file(path) as stream:
        stream.write(content)
    for old in sorted(path.parent.iterdir(), key=lambda entry: entry.stat().st_mtime)[:-_MOST_OF_A_KIND]:
        old.unlink()

"""Surfaces of fields, kept on this machine because they take long to shape.

Imports nothing slow: a surface that was kept is shown while all else is being imported.
"""

import hashlib
from pathlib import Path

import nerfnav
from nerfnav.core import cache

_KIND = "surfaces"  # in the cache
_APP, _LIBRARY = Path(__file__).parent.parent, Path(nerfnav.__file__).parent
_CODE = _APP / "places", _APP / "jobs", _LIBRARY / "field"  # which surfaces depend on


def kept_surface(field: Path) -> bytes | None:
    """The surface of a field's file that was shaped on this machine; None where none was, empty where there is none."""
    return cache.found(_KIND, _key(field))


def keep_surface(field: Path, glb: bytes) -> None:
    """Keep the surface of a field's file."""
    cache.keep(_KIND, _key(field), glb)


def _key(field: Path) -> bytes:
    return cache.code_of(*_CODE) + hashlib.sha256(field.read_bytes()).digest()

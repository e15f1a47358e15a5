"""Surfaces of fields, kept on this machine because they take long to make.

Imports nothing slow: a surface that was kept is shown while all else is being imported.
"""

import hashlib
from pathlib import Path

import nerfnav
from nerfnav.core import cache

_KIND = "surfaces"  # in the cache
_APP, _LIBRARY = Path(__file__).parent.parent, Path(nerfnav.__file__).parent
CODE = (
    *(_APP / path for path in ("jobs/export/surface.py", "places/surface_glb.py")),
    *(_LIBRARY / path for path in ("core/glb.py", "geometry/color.py", "geometry/grid.py", "geometry/images.py")),
    *(_LIBRARY / "field" / path for path in ("core", "models", "render", "storage", "surface")),
    *(_LIBRARY / "field/kernels" / path for path in ("cells.py", "light.py", "march.py", "shells.py")),
)
"""Modules that make surfaces."""


def kept_surface(field: Path) -> bytes | None:
    """Load the surface of a field's file; None where none was made on this machine, empty where there is none."""
    return cache.load(_KIND, _key(field))


def keep_surface(field: Path, glb: bytes) -> None:
    """Keep the surface of a field's file."""
    cache.store(_KIND, _key(field), glb)


def _key(field: Path) -> bytes:
    return cache.hash_code(*CODE) + hashlib.sha256(field.read_bytes()).digest()

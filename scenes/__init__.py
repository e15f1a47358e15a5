"""The places that come with nerfnav: one file per world, built by a function, found by name."""

import pickle
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import nerfnav
from nerfnav.cached import code_of, kept
from nerfnav.errors import UnknownNameError
from nerfnav.world.scene import Scene
from scenes import blocks, church, playground, stonehenge

_BUILDERS: dict[str, Callable[[], Scene]] = {
    "stonehenge": stonehenge.build,
    "playground": playground.build,
    "church": church.build,
    "blocks": blocks.build,
}


def names() -> list[str]:
    """The known scenes, the default one first."""
    return list(_BUILDERS)


@cache
def load(name: str) -> Scene:
    """The scene of that name, built once on this machine. Raises UnknownNameError, which lists the known names."""
    if name not in _BUILDERS:
        raise UnknownNameError("scene", name, names())
    here, library = Path(__file__).parent, Path(nerfnav.__file__).parent
    key = name.encode() + code_of(here, library / "world", library / "geometry")
    # only what this user's own nerfnav has written is unpickled, as with numba's cache of machine code
    return pickle.loads(kept("scenes", key, lambda: _pickled(_BUILDERS[name]())))


def _pickled(scene: Scene) -> bytes:
    """The scene without what trimesh has derived of its mesh, which is ten times as large and seldom needed."""
    return pickle.dumps(replace(scene, mesh=scene.mesh.copy()))


def trained_path(name: str) -> Path:
    """Where the trained field of a scene lies. Raises UnknownNameError, which lists the known names."""
    if name not in _BUILDERS:
        raise UnknownNameError("scene", name, names())
    return Path(__file__).parent / "trained" / f"{name}.npz"

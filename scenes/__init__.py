"""The places that come with nerfnav: one file per world, built by a function, found by name."""

import importlib
import pickle
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import nerfnav
from nerfnav.core.cache import hash_code, load_or_make
from nerfnav.core.errors import UnknownNameError
from nerfnav.world import Task

if TYPE_CHECKING:
    from nerfnav.world import Scene  # slow to import, and seldom needed at once

_NAMES = ("stonehenge", "playground", "church", "apartment", "blocks")


def names() -> list[str]:
    """The known scenes, the default one first."""
    return list(_NAMES)


@cache
def load(name: str) -> "Scene":
    """The scene of that name, built once on this machine. Raises UnknownNameError, which lists the known names."""
    _check(name)

    def build() -> bytes:
        scene = importlib.import_module(f"nerfnav_scenes.{name}").build()
        # without what trimesh has derived of its mesh, which is ten times as large and seldom needed
        return pickle.dumps(replace(scene, mesh=scene.mesh.copy()))

    here, library = Path(__file__).parent, Path(nerfnav.__file__).parent
    key = name.encode() + hash_code(here, library / "world", library / "geometry")
    # only what this user's own nerfnav has written is unpickled, as with numba's cache of machine code
    return pickle.loads(load_or_make("scenes", key, build))


def tasks_of(name: str) -> tuple[Task, ...]:
    """Tasks of that scene, known without building it. Raises as `load` does."""
    _check(name)
    return importlib.import_module(f"nerfnav_scenes.tasks.{name}").TASKS


def trained_path(name: str) -> Path:
    """Path of the trained field of a scene. Raises UnknownNameError, which lists the known names."""
    _check(name)
    return Path(__file__).parent / "trained" / f"{name}.npz"


def with_fields() -> list[str]:
    """Names of the scenes that have a trained field."""
    return [name for name in names() if trained_path(name).is_file()]


def _check(name: str) -> None:
    if name not in _NAMES:
        raise UnknownNameError("scene", name, _NAMES)

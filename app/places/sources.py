"""What the app can open: names of scenes, fields, and files from which a field is made first."""

import os
import re
from pathlib import Path

FIELD = ".npz"
"""Ending of a field that nerfnav wrote."""
SUFFIXES = (
    FIELD, ".glb", ".gltf", ".obj", ".ply", ".stl", ".dae", ".splat", ".zip", ".ckpt", ".tar", ".pth", ".pt",
)  # fmt: skip
"""Endings of the files that a browser can bring; a .zip holds a capture, a .ply a mesh or Gaussian splats, the last
four are checkpoints of trained NeRFs."""

_FOLDERS = re.compile(r"(?<![\w.:/~<])(?:~|\.{0,2})/(?:[^\s/:'\"<>]+/)+")
"""Folders of a path that begins at the root, at home or here; addresses of the web are none."""


def is_source(what: str) -> bool:
    """Whether a field must be made from `what` before it can be opened."""
    path = Path(what)
    return path.suffix.lower() in SUFFIXES and path.suffix.lower() != FIELD and path.is_file()


def title_of(what: str) -> str:
    """What visitors read: the name of a scene or file, never where it lies."""
    return Path(what).name


def without_paths(text: str) -> str:
    """A text for visitors in which files go by their names alone, wherever they lie."""
    return _FOLDERS.sub("", text)


def without_folder(text: str, what: str) -> str:
    """A text for visitors in which the file `what` goes by its name alone."""
    folder = str(Path(what).parent)
    return text if folder in (".", "/") else text.replace(folder + os.sep, "")

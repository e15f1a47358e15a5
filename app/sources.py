"""What the app can open: names of scenes, fields, and files from which a field is made first."""

import os
from pathlib import Path

FIELD = ".npz"
"""Ending of a field that nerfnav wrote."""
SUFFIXES = (FIELD, ".glb", ".gltf", ".obj", ".ply", ".stl", ".dae", ".splat", ".zip")
"""Endings of the files that a browser can bring; a .zip holds a capture, a .ply a mesh or Gaussian splats."""


def is_source(what: str) -> bool:
    """Whether a field must be made from `what` before it can be opened."""
    path = Path(what)
    return path.suffix.lower() in SUFFIXES and path.suffix.lower() != FIELD and path.is_file()


def title_of(what: str) -> str:
    """What visitors read: the name of a scene or file, never where it lies."""
    return Path(what).name


def without_folder(text: str, what: str) -> str:
    """A text for visitors in which the file `what` goes by its name alone."""
    folder = str(Path(what).parent)
    return text if folder in (".", "/") else text.replace(folder + os.sep, "")

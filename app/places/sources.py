"""What the app can open: names of scenes, fields, and files from which a field is made first."""

import os
import re
from pathlib import Path

from nerfnav.importers.core.kinds import UPLOADS as SUFFIXES

__all__ = ["SUFFIXES", "title_of", "without_folder", "without_paths"]

_FOLDERS = re.compile(r"(?<![\w.:/~<])(?:~|\.{0,2})/(?:[^\s/:'\"<>]+/)+")
"""Folders of a path that begins at the root, at home or here; addresses of the web are none."""


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

"""Sources that the app can open: names of scenes, fields, files from which a field is made first; and the quality and
time budget of making it.
"""

import os
import re
from pathlib import Path
from typing import Literal

from nerfnav.importers.core.kinds import UPLOADS as SUFFIXES

QualityName = Literal["draft", "good", "best"]
"""Names of nerfnav_app.jobs.field.request.QUALITIES."""
USUAL: QualityName = "good"
BUDGETS_S: dict[QualityName, float] = {"draft": 20.0, "good": 60.0, "best": 240.0}
"""Time that is spent on learning a field in the page [s]: the usual one is enough to fly in, and short enough to wait
for."""

PICTURE_EVERY_S = 1.0
"""Time between two pictures of a field in training in the page [s]."""


__all__ = ["SUFFIXES", "title_of", "without_folder", "without_paths"]

_FOLDERS = re.compile(r"(?<![\w.:/~<])(?:~|\.{0,2})/(?:[^\s/:'\"<>]+/)+")
"""Folders of a path that begins at the root, at home or here; addresses of the web are none."""


def title_of(what: str) -> str:
    """Title for visitors: the name of a scene or file, without its folder."""
    return Path(what).name


def without_paths(text: str) -> str:
    """A text for visitors in which files go by their names alone, wherever they lie."""
    return _FOLDERS.sub("", text)


def without_folder(text: str, what: str) -> str:
    """A text for visitors in which the file `what` goes by its name alone."""
    folder = str(Path(what).parent)
    return text if folder in (".", "/") else text.replace(folder + os.sep, "")

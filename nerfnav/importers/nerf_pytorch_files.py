"""Files of trained NeRFs of nerf-pytorch."""

import re
from pathlib import Path

from nerfnav.errors import InvalidInputError
from nerfnav.importers.nerf_pytorch_weights import listed
from nerfnav.importers.suffixes import CHECKPOINTS as SUFFIXES


def is_checkpoint(path: Path) -> bool:
    """Whether a user means a checkpoint: a file by its ending, a folder by what is in it."""
    if path.is_dir():
        return any(entry.suffix.lower() in SUFFIXES for entry in path.iterdir())
    return path.suffix.lower() in SUFFIXES


def newest(folder: Path) -> Path:
    found = [entry for entry in folder.iterdir() if entry.suffix.lower() in SUFFIXES and entry.is_file()]
    if not found:
        raise InvalidInputError(f"{folder} holds no checkpoint; a trained NeRF is a file ending in {listed(SUFFIXES)}")
    return max(found, key=lambda entry: (int("0" + "".join(re.findall(r"\d+", entry.stem)[-1:])), entry.name))

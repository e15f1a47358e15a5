"""Checkpoints of nerf-pytorch: find them, and read their weights without running what a pickle may hold."""

import pickle
import re
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.formats import list_folder
from nerfnav.importers.core.kinds import CHECKPOINTS as SUFFIXES

_NETWORKS = (("model_coarse_state_dict", "model_fine_state_dict"), ("network_fn_state_dict", "network_fine_state_dict"))
_MORE_THAN_WEIGHTS = ("GLOBAL", "Unsupported global", "Unsupported class")
"""Words with which torch refuses a pickle that names code."""


def state_dicts(file: Path) -> tuple[dict[str, Tensor], dict[str, Tensor]]:
    """Weights of the coarse and the fine network; one for both where there is no fine one."""
    if not file.is_file():
        raise InvalidInputError(f"there is no checkpoint {file}")
    if file.stat().st_size == 0:
        raise InvalidInputError(f"{file} is empty: a checkpoint of nerf-pytorch was expected")
    try:
        loaded = torch.load(file, map_location="cpu", weights_only=True)
    except pickle.UnpicklingError as error:
        with file.open("rb") as opened:
            foreign = opened.read(1) == b"\x80" and "Unsupported operand" in str(error)  # a pickle torch never writes
        if foreign or any(word in str(error) for word in _MORE_THAN_WEIGHTS):
            raise InvalidInputError(
                f"{file} was refused and nothing in it was run: it holds more than weights, such as code"
            ) from error
        raise _not_whole(file) from error
    except (RuntimeError, EOFError, ValueError, LookupError, TypeError, AttributeError, AssertionError) as error:
        raise _not_whole(file) from error
    for names in _NETWORKS:
        if isinstance(loaded, dict) and isinstance(loaded.get(names[0]), dict):
            states = [_tensors(loaded[name], file) for name in names if isinstance(loaded.get(name), dict)]
            return states[0], states[-1]
    raise InvalidInputError(
        f"{file} holds no networks of nerf-pytorch: {' or '.join(name for name, _ in _NETWORKS)} was expected"
    )


def _tensors(state: dict[Any, Any], file: Path) -> dict[str, Tensor]:
    tensors = {str(name).removeprefix("module."): part for name, part in state.items() if isinstance(part, Tensor)}
    if not all(bool(part.isfinite().all()) for part in tensors.values()):
        raise InvalidInputError(f"{file} holds weights that are not finite: its training has failed")
    return {name: part.float() for name, part in tensors.items()}


def _not_whole(file: Path) -> InvalidInputError:
    return InvalidInputError(f"{file} is not a whole checkpoint of nerf-pytorch (truncated, or another kind of file)")


def is_checkpoint(path: Path) -> bool:
    """True for a checkpoint: a file by its ending, a folder by its content."""
    if path.is_dir():
        return any(entry.suffix.lower() in SUFFIXES for entry in list_folder(path))
    return path.suffix.lower() in SUFFIXES


def newest_checkpoint(folder: Path) -> Path:
    """Checkpoint of a folder with the highest number in its name. Raises InvalidInputError where there is none."""
    found = [entry for entry in list_folder(folder) if entry.suffix.lower() in SUFFIXES and entry.is_file()]
    if not found:
        raise InvalidInputError(
            f"{folder} holds no checkpoint; a trained NeRF is a file ending in {' or '.join(SUFFIXES)}"
        )
    return max(found, key=lambda entry: (int("0" + "".join(re.findall(r"\d+", entry.stem)[-1:])), entry.name))

"""Trained NeRFs of nerf-pytorch: networks of krrish94/nerf-pytorch and yenchenlin/nerf-pytorch, coarse and fine.

The shapes are read from the weights; the configuration beside them, which may speak of another run, only says how far
the cameras saw and what is behind everything. Checkpoints are pickles: they are read with `weights_only=True`, which
runs no code, and what asks for code is refused.
"""

import math
import pickle
import re
from dataclasses import dataclass, replace
from dataclasses import field as dataclass_field
from pathlib import Path
from typing import Any, cast

import numpy as np
import torch
import yaml
from scipy import ndimage
from torch import Tensor

from nerfnav.errors import InvalidInputError
from nerfnav.field.info import FieldInfo
from nerfnav.field.neural import NeuralConfig, NeuralField
from nerfnav.geometry.box import Box
from nerfnav.geometry.camera import Pose
from nerfnav.geometry.grid import node_positions, shape_for
from nerfnav.importers.nerf_pytorch_networks import network_of
from nerfnav.importers.placement import Placement, rotation_to_z
from nerfnav.importers.suffixes import CHECKPOINTS as SUFFIXES

_NETWORKS = (("model_coarse_state_dict", "model_fine_state_dict"), ("network_fn_state_dict", "network_fine_state_dict"))
_CONFIGS = ("config.yml", "config.yaml", "config.txt", "args.txt")
_SEEN_SHARE = 0.75
"""Half the edge of the box that is searched for density, in half the range between near and far: what lies further
out, few cameras saw, and networks make up fog there."""
_MORE_THAN_WEIGHTS = ("GLOBAL", "Unsupported global", "Unsupported class")
"""Words with which torch refuses a pickle that names code."""
_SEARCH_CELLS = 56
_SOLID = 10.0  # [1/unit]: density that makes a node part of the scene when the box is found
_LEAST_PART = 0.01  # connected parts with a smaller share of all solid nodes are floaters


@dataclass(frozen=True)
class NerfPytorchConfig:
    """How a checkpoint is read."""

    placement: Placement = dataclass_field(default_factory=Placement)
    """Which way is up in the networks' axes (by default z), how long their unit is (1 m), which part is wanted (what
    is solid)."""
    near: float = 2.0
    """Distance from which the cameras saw [unit], where the configuration says nothing plausible."""
    far: float = 6.0
    """Distance to which they saw [unit]."""
    octaves: tuple[bool, bool] = (True, True)
    """Whether frequencies of positions and of directions double, where the configuration does not say."""
    white: bool = True
    """Whether what nothing stops is white, else black, where the configuration says nothing."""


def load_nerf_pytorch(path: Path, config: NerfPytorchConfig | None = None) -> NeuralField:
    """Read a checkpoint, or the newest one of a folder; raises InvalidInputError, in one sentence, for all else."""
    config = NerfPytorchConfig() if config is None else config
    file = _newest(path) if path.is_dir() else path
    config, states = _configured(file.parent, config), _state_dicts(file)
    coarse, fine = (network_of(state, str(file), config.octaves) for state in states)
    place = config.placement
    unit = place.meters_per_unit or 1.0
    turn = torch.eye(3) if place.up is None else torch.from_numpy(rotation_to_z(np.array(place.up))).float()
    half = torch.full((3,), unit * _SEEN_SHARE * 0.5 * (config.far - config.near))
    box = Box(-half, half) if place.box is None else Box.of(*place.box)
    frame, background = Pose(turn, torch.zeros(3)), torch.full((3,), float(config.white))
    field = NeuralField(
        box, coarse, fine, background, frame, NeuralConfig(unit=unit), FieldInfo(source=file.name)
    )
    return field if place.box is not None else replace(field, box=_solid_box(field, file))


def is_checkpoint(path: Path) -> bool:
    """Whether a user means a checkpoint: a file by its ending, a folder by what is in it."""
    if path.is_dir():
        return any(entry.suffix.lower() in SUFFIXES for entry in path.iterdir())
    return path.suffix.lower() in SUFFIXES


def _newest(folder: Path) -> Path:
    found = [entry for entry in folder.iterdir() if entry.suffix.lower() in SUFFIXES and entry.is_file()]
    if not found:
        raise InvalidInputError(f"{folder} holds no checkpoint; a trained NeRF is a file ending in {_listed(SUFFIXES)}")
    return max(found, key=lambda entry: (int("0" + "".join(re.findall(r"\d+", entry.stem)[-1:])), entry.name))


def _state_dicts(file: Path) -> tuple[dict[str, Tensor], dict[str, Tensor]]:
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
        f"{file} holds no networks of nerf-pytorch: {_listed(name for name, _ in _NETWORKS)} was expected"
    )


def _tensors(state: dict[Any, Any], file: Path) -> dict[str, Tensor]:
    tensors = {str(name).removeprefix("module."): part for name, part in state.items() if isinstance(part, Tensor)}
    if not all(bool(part.isfinite().all()) for part in tensors.values()):
        raise InvalidInputError(f"{file} holds weights that are not finite: its training has failed")
    return {name: part.float() for name, part in tensors.items()}


def _not_whole(file: Path) -> InvalidInputError:
    return InvalidInputError(f"{file} is not a whole checkpoint of nerf-pytorch (truncated, or another kind of file)")


def _configured(folder: Path, config: NerfPytorchConfig) -> NerfPytorchConfig:
    """`config` with what the run's own configuration says, as far as that is plausible."""
    sections = _sections(folder)
    said, dataset = _flat(sections), sections.get("dataset")
    # networks have a type, too: the photographs' stands in their own section, or at the top
    told = dataset if isinstance(dataset, dict) else sections
    kind = str(told.get("type", told.get("dataset_type", ""))).lower()
    if kind == "llff" and not _true(told.get("no_ndc", said.get("no_ndc", False))):
        raise InvalidInputError(
            f"the NeRF in {folder} was trained in normalised device coordinates (llff without no_ndc), where lengths "
            "mean nothing: train it with no_ndc"
        )
    near, far = said.get("near"), said.get("far")
    if isinstance(near, int | float) and isinstance(far, int | float) and 0 <= near < far < math.inf:
        config = replace(config, near=float(near), far=float(far))
    position, direction = config.octaves
    doubling = (_true(said.get("log_sampling_xyz", position)), _true(said.get("log_sampling_dir", direction)))
    config = replace(config, octaves=doubling)
    for name in ("white_background", "white_bkgd"):
        if name in said:
            config = replace(config, white=_true(said[name]))
    return config


def _sections(folder: Path) -> dict[str, Any]:
    """Names and values of the first configuration in a folder, in their sections."""
    for name in _CONFIGS:
        if (folder / name).is_file():
            text = (folder / name).read_text(errors="replace")
            if name.endswith(".txt"):
                text = re.sub(r"^\s*(\w+)\s*=", r"\1:", text, flags=re.MULTILINE)
            try:
                loaded = yaml.safe_load(text)
                return loaded if isinstance(loaded, dict) else {}
            except yaml.YAMLError:
                return {}  # weights say what matters; what the file would add has defaults
    return {}


def _flat(section: Any) -> dict[str, Any]:
    """The same without sections; later ones win."""
    flat: dict[str, Any] = {}
    for name, value in section.items() if isinstance(section, dict) else ():
        flat |= _flat(value) if isinstance(value, dict) else {str(name): value}
    return flat


def _true(value: Any) -> bool:
    return value if isinstance(value, bool) else str(value).lower() in ("true", "1", "yes")


def _solid_box(field: NeuralField, file: Path) -> Box:
    """The part of the field's box that holds what is solid, and two cells around it."""
    spacing = float(field.box.size.max()) / _SEARCH_CELLS
    nodes = node_positions(field.box, shape_for(field.box, spacing))
    with torch.no_grad():
        solid = (field.density(nodes) > _SOLID / field.config.unit).numpy()
    labels, count = cast("tuple[np.ndarray, int]", ndimage.label(solid))
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    kept = solid & (sizes[labels] >= _LEAST_PART * solid.sum())
    if not kept.any():
        raise InvalidInputError(f"{file} shows nothing solid within {field.box.describe()}: give the box that it fills")
    found = nodes[torch.from_numpy(kept)]
    lower, upper = found.amin(0) - 2 * spacing, found.amax(0) + 2 * spacing
    return Box(torch.maximum(lower, field.box.lower), torch.minimum(upper, field.box.upper))


def _listed(names: Any) -> str:
    return " or ".join(names)

"""Configuration of a checkpoint of nerf-pytorch: what the user gives, and what lies beside the weights."""

import math
import re
from dataclasses import dataclass, replace
from dataclasses import field as dataclass_field
from pathlib import Path
from typing import Any

import yaml

from nerfnav.core.errors import InvalidInputError
from nerfnav.importers.core.placement import Placement

_CONFIGS = ("config.yml", "config.yaml", "config.txt", "args.txt")


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


def merge_run_config(folder: Path, config: NerfPytorchConfig) -> NerfPytorchConfig:
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

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
    """Options of a checkpoint import."""

    placement: Placement = dataclass_field(default_factory=Placement)
    """Up in the networks' axes (default z), metres per unit (1), and box (the solid part)."""
    near: float = 2.0
    """Near distance of the cameras [unit], where the configuration has no plausible one."""
    far: float = 6.0
    """Far distance of the cameras [unit]."""
    octaves: tuple[bool, bool] = (True, True)
    """Frequencies of positions and of directions double, where the configuration does not define them."""
    white: bool = True
    """White background, else black, where the configuration does not define it."""


def merge_run_config(folder: Path, config: NerfPytorchConfig) -> NerfPytorchConfig:
    """Update `config` from the run's own configuration, as far as that is plausible."""
    sections = _sections(folder)
    entries, dataset = _flat(sections), sections.get("dataset")
    # networks have a type, too: the photographs' stands in their own section, or at the top
    section = dataset if isinstance(dataset, dict) else sections
    kind = str(section.get("type", section.get("dataset_type", ""))).lower()
    if kind == "llff" and not _true(section.get("no_ndc", entries.get("no_ndc", False))):
        raise InvalidInputError(
            f"the NeRF in {folder} was trained in normalised device coordinates (llff without no_ndc), where lengths "
            "mean nothing: train it with no_ndc"
        )
    near, far = entries.get("near"), entries.get("far")
    if isinstance(near, int | float) and isinstance(far, int | float) and 0 <= near < far < math.inf:
        config = replace(config, near=float(near), far=float(far))
    position = _true(entries.get("log_sampling_xyz", config.octaves[0]))
    config = replace(config, octaves=(position, _true(entries.get("log_sampling_dir", config.octaves[1]))))
    for name in ("white_background", "white_bkgd"):
        if name in entries:
            config = replace(config, white=_true(entries[name]))
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

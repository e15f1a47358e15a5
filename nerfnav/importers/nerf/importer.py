"""NeRF importer: read the coarse and fine networks of krrish94/nerf-pytorch and yenchenlin/nerf-pytorch.

The shapes are read from the weights; the configuration beside them, which may be that of another run, only gives the
range of the cameras and the background. Checkpoints are pickles: they are read with `weights_only=True`, which
runs no code and refuses files that hold any.

The box of the field encloses the solid part of space.
"""

from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np
import scipy
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.field import FieldInfo, NeuralConfig, NeuralField
from nerfnav.geometry import Box, Pose, node_positions, shape_for
from nerfnav.importers.core.placement import rotation_to_z
from nerfnav.importers.nerf.checkpoint import newest_checkpoint, state_dicts
from nerfnav.importers.nerf.config import NerfPytorchConfig, merge_run_config
from nerfnav.importers.nerf.networks import build_network

_SEARCH_CELLS = 56
_SOLID = 10.0  # [1/unit]: density that makes a node part of the scene when the box is found
_LEAST_PART = 0.01  # connected parts with a smaller share of all solid nodes are floaters


def find_solid_box(field: NeuralField, file: Path) -> Box:
    """The part of the field's box that holds what is solid, and two cells around it."""
    spacing = float(field.box.size.max()) / _SEARCH_CELLS
    nodes = node_positions(field.box, shape_for(field.box, spacing))
    with torch.no_grad():
        solid = (field.density(nodes) > _SOLID / field.config.unit).numpy()
    labels, count = cast("tuple[np.ndarray, int]", scipy.ndimage.label(solid))
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    kept = solid & (sizes[labels] >= _LEAST_PART * solid.sum())
    if not kept.any():
        raise InvalidInputError(f"{file} shows nothing solid within {field.box.describe()}: give the box that it fills")
    found = nodes[torch.from_numpy(kept)]
    lower, upper = found.amin(0) - 2 * spacing, found.amax(0) + 2 * spacing
    return Box(torch.maximum(lower, field.box.lower), torch.minimum(upper, field.box.upper))


_SEEN_SHARE = 0.75
"""Half the edge of the box that is searched for density, in half the range between near and far: what lies further
out, few cameras saw, and networks make up fog there."""


def load_nerf_pytorch(path: Path, config: NerfPytorchConfig | None = None) -> NeuralField:
    """Read a checkpoint, or the newest one of a folder; raises InvalidInputError, in one sentence, for all else."""
    config = NerfPytorchConfig() if config is None else config
    file = newest_checkpoint(path) if path.is_dir() else path
    config, states = merge_run_config(file.parent, config), state_dicts(file)
    coarse, fine = (build_network(state, str(file), config.octaves) for state in states)
    place = config.placement
    unit = place.meters_per_unit or 1.0
    turn = torch.eye(3) if place.up is None else torch.from_numpy(rotation_to_z(np.array(place.up))).float()
    half = torch.full((3,), unit * _SEEN_SHARE * 0.5 * (config.far - config.near))
    box = Box(-half, half) if place.box is None else Box.of(*place.box)
    field = NeuralField(
        box,
        coarse,
        fine,
        torch.full((3,), float(config.white)),  # the background
        Pose(turn, torch.zeros(3)),
        NeuralConfig(unit=unit),
        FieldInfo(source=file.name, made_by="imported"),
    )
    return field if place.box is not None else replace(field, box=find_solid_box(field, file))

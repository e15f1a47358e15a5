"""Trained NeRFs of nerf-pytorch: networks of krrish94/nerf-pytorch and yenchenlin/nerf-pytorch, coarse and fine.

The shapes are read from the weights; the configuration beside them, which may speak of another run, only says how far
the cameras saw and what is behind everything. Checkpoints are pickles: they are read with `weights_only=True`, which
runs no code, and what asks for code is refused.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from nerfnav.field import FieldInfo, NeuralConfig, NeuralField
from nerfnav.geometry import Box, Pose
from nerfnav.importers.nerf_pytorch_box import solid_box
from nerfnav.importers.nerf_pytorch_config import NerfPytorchConfig, configured
from nerfnav.importers.nerf_pytorch_files import newest
from nerfnav.importers.nerf_pytorch_networks import network_of
from nerfnav.importers.nerf_pytorch_weights import state_dicts
from nerfnav.importers.placement import rotation_to_z

_SEEN_SHARE = 0.75
"""Half the edge of the box that is searched for density, in half the range between near and far: what lies further
out, few cameras saw, and networks make up fog there."""


def load_nerf_pytorch(path: Path, config: NerfPytorchConfig | None = None) -> NeuralField:
    """Read a checkpoint, or the newest one of a folder; raises InvalidInputError, in one sentence, for all else."""
    config = NerfPytorchConfig() if config is None else config
    file = newest(path) if path.is_dir() else path
    config, states = configured(file.parent, config), state_dicts(file)
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
    return field if place.box is not None else replace(field, box=solid_box(field, file))

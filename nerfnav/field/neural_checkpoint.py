"""Neural fields in files: the weights of both networks and how they are read, as npz without pickle, versioned.

`nerfnav.field.checkpoint.load_field` opens these files too.
"""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch

from nerfnav.errors import FieldFileError
from nerfnav.field.info import FieldInfo
from nerfnav.field.mlp import Encoding, MlpConfig, RadianceMlp
from nerfnav.field.neural import Activation, NeuralConfig, NeuralField
from nerfnav.files import write_npz
from nerfnav.geometry.box import Box
from nerfnav.geometry.camera import Pose

FORMAT = "nerfnav-neural-field"
"""What the header of such a file says."""
VERSION = 1
"""Raised whenever older programs could not read what is written."""


def save_neural_field(field: NeuralField, path: Path) -> int:
    """Write a field to `path` and return its size in bytes. An existing file is replaced only once all is written."""
    header = {
        "format": FORMAT,
        "version": VERSION,
        "info": asdict(field.info),
        "config": {**asdict(field.config), "activation": field.config.activation.value},
        "networks": {name: asdict(network.config) for name, network in _networks(field)},
    }
    arrays = {
        "box": torch.stack([field.box.lower, field.box.upper]),
        "background": field.background,
        "rotation": field.frame.rotation,
        "position": field.frame.position,
    }
    for name, network in _networks(field):
        arrays |= {f"{name}.{key}": weights for key, weights in network.state_dict().items()}
    numbers = {name: array.detach().cpu().numpy() for name, array in arrays.items()}
    try:
        return write_npz(path, {"header": np.array(json.dumps(header)), **numbers})
    except OSError as error:
        raise FieldFileError(f"the field cannot be written to {path}: {error.strerror}") from error


def neural_field_of(file: Any, header: dict[str, Any]) -> NeuralField:
    """The field in an opened npz whose header has this format.

    Raises KeyError, ValueError, TypeError or RuntimeError where it is not whole, which `load_field` puts into a
    sentence.
    """
    box, rotation = torch.from_numpy(file["box"]), torch.from_numpy(file["rotation"])
    if box.shape != (2, 3) or rotation.shape != (3, 3) or not bool((box[1] > box[0]).all()):
        raise ValueError("arrays of wrong shape, or an empty box")
    networks = {name: _network(file, name, shape) for name, shape in header["networks"].items()}
    config = NeuralConfig(**{**header["config"], "activation": Activation(header["config"]["activation"])})
    return NeuralField(
        Box(box[0], box[1]),
        networks["coarse"],
        networks["fine"],
        torch.from_numpy(file["background"]),
        Pose(rotation, torch.from_numpy(file["position"])),
        config,
        FieldInfo.of(header["info"]),
    )


def _networks(field: NeuralField) -> tuple[tuple[str, RadianceMlp], ...]:
    return ("coarse", field.coarse), ("fine", field.fine)


def _network(file: Any, name: str, shape: dict[str, Any]) -> RadianceMlp:
    direction = shape["direction"]
    config = MlpConfig(**{
        **shape,
        "skips": tuple(shape["skips"]),
        "view_widths": tuple(shape["view_widths"]),
        "position": Encoding(**shape["position"]),
        "direction": None if direction is None else Encoding(**direction),
    })
    network = RadianceMlp(config)
    network.load_state_dict({key: torch.from_numpy(file[f"{name}.{key}"]) for key in network.state_dict()})
    return network.requires_grad_(False)

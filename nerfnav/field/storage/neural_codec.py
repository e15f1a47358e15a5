"""Codec of neural fields: the weights of both networks and how they are read."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np
import torch

from nerfnav.field.core.codec import Encoded, FieldCodec
from nerfnav.field.core.info import FieldInfo
from nerfnav.field.models.mlp import Encoding, MlpConfig, RadianceMlp
from nerfnav.field.models.neural import Activation, NeuralConfig, NeuralField
from nerfnav.geometry import Box, Pose


def encode(field: NeuralField) -> Encoded:
    """Encode a neural field (see FieldCodec)."""
    header = {
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
    return Encoded(header, {name: array.detach().cpu().numpy() for name, array in arrays.items()})


def decode(header: Mapping[str, Any], file: Mapping[str, np.ndarray]) -> NeuralField:
    """Decode a neural field (see FieldCodec)."""
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


def _network(file: Mapping[str, np.ndarray], name: str, shape: dict[str, Any]) -> RadianceMlp:
    direction = shape["direction"]
    network = RadianceMlp(MlpConfig(**{
        **shape,
        "skips": tuple(shape["skips"]),
        "view_widths": tuple(shape["view_widths"]),
        "position": Encoding(**shape["position"]),
        "direction": None if direction is None else Encoding(**direction),
    }))
    network.load_state_dict({key: torch.from_numpy(file[f"{name}.{key}"]) for key in network.state_dict()})
    return network.requires_grad_(False)


NEURAL = FieldCodec("nerfnav-neural-field", 1, NeuralField, encode, decode)

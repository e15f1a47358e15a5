"""Codec of neural fields: the weights of both networks and how they are read."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import msgspec
import numpy as np
import torch

from nerfnav.field.core.codec import Encoded, FieldCodec
from nerfnav.field.core.info import FieldInfo
from nerfnav.field.models.mlp import MlpConfig, RadianceMlp
from nerfnav.field.models.neural import NeuralConfig, NeuralField
from nerfnav.field.storage.array_encoding import check_numbers, decode_box
from nerfnav.geometry import Pose


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
    rotation, position = check_numbers("rotation", file["rotation"], (3, 3)), file["position"]
    networks = {name: _network(file, name, shape) for name, shape in header["networks"].items()}
    config = msgspec.convert(header["config"], NeuralConfig)
    return NeuralField(
        decode_box(file["box"]),
        networks["coarse"],
        networks["fine"],
        check_numbers("background", file["background"], (3,)),
        Pose(rotation, check_numbers("position", position, (3,))),
        config,
        FieldInfo.of(header["info"]),
    )


def _networks(field: NeuralField) -> tuple[tuple[str, RadianceMlp], ...]:
    return ("coarse", field.coarse), ("fine", field.fine)


def _network(file: Mapping[str, np.ndarray], name: str, shape: dict[str, Any]) -> RadianceMlp:
    config = msgspec.convert(shape, MlpConfig)
    if not 1 <= config.depth <= len(file):
        raise ValueError(f"its network {name!r} has a depth of {config.depth}, and there are {len(file)} arrays")
    with torch.device("meta"):  # no memory for numbers that a damaged header alone promises
        network = RadianceMlp(config)
    weights = {
        key: check_numbers(f"{name}.{key}", file[f"{name}.{key}"], tuple(wanted.shape))
        for key, wanted in network.state_dict().items()
    }
    network.load_state_dict(weights, assign=True)
    return network.requires_grad_(False)


NEURAL = FieldCodec("nerfnav-neural-field", 1, NeuralField, encode, decode)

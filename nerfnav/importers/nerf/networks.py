"""Networks of nerf-pytorch as nerfnav's own (nerfnav/field/models/mlp.py); the shapes are read from the weights.

What differs is rewritten exactly. krrish94's FlexibleNeRFModel has no relu after its first layer, and its later layers
have the hidden part first and gamma(p) last. In its PaperNeRFModel density is linear in the features, which are linear
in h: the product is linear in h.
"""

from dataclasses import replace

import torch
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.field import MlpConfig
from nerfnav.field.models.mlp import Encoding, RadianceMlp

_PARTS = ((0, "weight"), (1, "bias"))


def build_network(state: dict[str, Tensor], where: str, octaves: tuple[bool, bool] = (True, True)) -> RadianceMlp:
    """Build the network of either project; `where` names its file in errors.

    `octaves`: frequencies of positions and directions double; the weights have the same shapes either way.
    Raises InvalidInputError for unknown shapes.
    """
    try:
        config, weights = _yenchenlin(state) if "pts_linears.0.weight" in state else _krrish94(state)
        direction = config.direction and replace(config.direction, octaves=octaves[1])
        position = replace(config.position, octaves=octaves[0])
        network = RadianceMlp(replace(config, position=position, direction=direction))
        network.load_state_dict(weights)
    except (KeyError, RuntimeError, ValueError, IndexError) as error:
        raise InvalidInputError(
            f"{where} holds a network of an unknown shape; known are FlexibleNeRFModel and PaperNeRFModel of "
            "krrish94/nerf-pytorch and NeRF of yenchenlin/nerf-pytorch"
        ) from error
    return network.requires_grad_(False)


def _yenchenlin(state: dict[str, Tensor]) -> tuple[MlpConfig, dict[str, Tensor]]:
    layers = _layers(state, "pts_linears")
    width, encoded = layers[0][0].shape
    heads: dict[str, str] = {"density": "alpha_linear", "color": "rgb_linear", "feature": "feature_linear"}
    config = MlpConfig(len(layers), width, _skips(layers, width), _encoding(encoded))
    return _assembled(config, layers, state, heads, _layers(state, "views_linears"), "output_linear")


def _krrish94(state: dict[str, Tensor]) -> tuple[MlpConfig, dict[str, Tensor]]:
    layers, heads = _layers(state, "layers_xyz"), {"density": "fc_alpha", "color": "fc_rgb", "feature": "fc_feat"}
    seen = _layers(state, "layers_dir")
    if "layer1.weight" not in state:  # PaperNeRFModel: density comes after the features, the last layer is not used
        width, encoded = layers[0][0].shape
        config = MlpConfig(len(layers), width, _skips(layers, width), _encoding(encoded))
        features, bias = state["fc_feat.weight"], state["fc_feat.bias"]
        alpha = state["fc_alpha.weight"]
        state = {**state, "fc_alpha.weight": alpha @ features, "fc_alpha.bias": alpha @ bias + state["fc_alpha.bias"]}
        return _assembled(config, layers, state, heads, seen[:3], "fc_out")
    width, encoded = state["layer1.weight"].shape
    # in the file the columns are hidden, then gamma(p)
    later = [(torch.cat([weight[:, width:], weight[:, :width]], 1), bias) for weight, bias in layers]
    joined = [(state["layer1.weight"], state["layer1.bias"]), *later]
    skips = _skips(joined, width)
    config = MlpConfig(len(joined), width, skips, _encoding(encoded), linear_first=True, feature_relu=True)
    return _assembled(config, joined, state, heads, seen, "fc_out")


def _assembled(
    config: MlpConfig,
    layers: list[tuple[Tensor, Tensor]],
    state: dict[str, Tensor],
    heads: dict[str, str],
    seen: list[tuple[Tensor, Tensor]],
    joint: str,
) -> tuple[MlpConfig, dict[str, Tensor]]:
    """Complete the config with the layers `seen` by directions, and all weights under nerfnav's names."""
    weights = {f"hidden.{index}.{part}": pair[which] for index, pair in enumerate(layers) for which, part in _PARTS}
    if f"{joint}.weight" in state:  # colour and density in one, whatever the direction
        for _, part in _PARTS:
            weights[f"color.{part}"] = state[f"{joint}.{part}"][:3]
            weights[f"density.{part}"] = state[f"{joint}.{part}"][3:4]
        return replace(config, direction=None, view_widths=()), weights
    for head, name in heads.items():
        weights |= {f"{head}.{part}": state[f"{name}.{part}"] for _, part in _PARTS}
    weights |= {f"view.{index}.{part}": pair[which] for index, pair in enumerate(seen) for which, part in _PARTS}
    direction = _encoding(seen[0][0].shape[1] - config.width)
    return replace(config, direction=direction, view_widths=tuple(len(bias) for _, bias in seen)), weights


def _layers(state: dict[str, Tensor], name: str) -> list[tuple[Tensor, Tensor]]:
    count = sum(f"{name}.{index}.weight" in state for index in range(len(state)))
    return [(state[f"{name}.{index}.weight"], state[f"{name}.{index}.bias"]) for index in range(count)]


def _skips(layers: list[tuple[Tensor, Tensor]], width: int) -> tuple[int, ...]:
    return tuple(index for index, (weight, _) in enumerate(layers) if index and weight.shape[1] > width)


def _encoding(width: int) -> Encoding:
    """Encoding of `width` numbers: 3 for the vector itself, where it is included, 6 for each frequency."""
    if width < 3 or width % 6 not in (0, 3):
        raise ValueError("no encoding of three numbers has this width")
    return Encoding(width // 6, include_input=width % 6 == 3)

"""Neural field before its training: networks with random weights."""

import math

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.field.mlp import MlpConfig, RadianceMlp
from nerfnav.field.neural import Activation, NeuralConfig, NeuralField
from nerfnav.geometry import Box, Pose


def blank_field(
    box: Box,
    background: Float[Tensor, "3"],
    network: MlpConfig,
    generator: torch.Generator,
    device: torch.device | str = "cpu",
) -> NeuralField:
    """Two networks with random weights for a box; their unit is half its longest edge, so points are in [-1, 1]."""
    coarse, fine = (_random(RadianceMlp(network), generator).to(device) for _ in range(2))
    config = NeuralConfig(unit=0.5 * float(box.size.max()), activation=Activation.SOFTPLUS)
    frame = Pose(torch.eye(3), box.center)
    return NeuralField(box, coarse, fine, background, frame, config)


def _random(network: RadianceMlp, generator: torch.Generator) -> RadianceMlp:
    """The network with weights by He's rule for relus (He et al., ICCV 2015) from `generator`."""
    for name, weights in network.named_parameters():
        with torch.no_grad():
            if name.endswith("bias"):
                weights.zero_()
            else:
                bound = math.sqrt(6 / weights.shape[1])
                weights.copy_((2 * torch.rand(weights.shape, generator=generator) - 1) * bound)
    return network

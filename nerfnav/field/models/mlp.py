"""NeRF network: an MLP from an encoded point and viewing direction to raw density and colour.

Notation: gamma(x) = (x, sin f_0 x, cos f_0 x, sin f_1 x, ...), frequencies f_k = 2^k. Hidden layers h turn gamma(p)
into features; raw density is linear in them, the colour also knows gamma(d):

    h_0 = relu(W_0 gamma(p)),  h_i = relu(W_i [gamma(p),] h_{i-1}),  raw = a . h,
    c = sigmoid(B relu(V [f(h), gamma(d)]))

(Mildenhall et al., "NeRF", ECCV 2020, Eq. 4 and Fig. 7: 8 layers of 256, gamma(p) again in the sixth.)
"""

from dataclasses import dataclass, field

import torch
from jaxtyping import Float
from torch import Tensor, nn

Points = Float[Tensor, "*batch 3"]


@dataclass(frozen=True)
class Encoding:
    """Positional encoding of a vector: itself, and sines and cosines of its multiples."""

    frequencies: int = 10
    """Number of multiples."""
    include_input: bool = True
    """The vector itself is part of the encoding."""
    octaves: bool = True
    """Each frequency is twice the one before; else they are evenly spaced up to the same highest one."""

    @property
    def width(self) -> int:
        """Numbers for a vector of three."""
        return 3 * self.include_input + 6 * self.frequencies

    def __call__(self, points: Points) -> Float[Tensor, "*batch width"]:
        """gamma of vectors, sines and cosines in turn, frequency by frequency."""
        last = self.frequencies - 1
        multiples = 2.0 ** torch.arange(self.frequencies) if self.octaves else torch.linspace(1, 2.0**last, last + 1)
        phase = points[..., None, :] * multiples[:, None].to(points)
        waves = torch.stack([phase.sin(), phase.cos()], -2).flatten(-3)
        return torch.cat([points, waves], -1) if self.include_input else waves


@dataclass(frozen=True)
class MlpConfig:
    """The shape of a network; the paper's by default."""

    depth: int = 8
    """Hidden layers between the encoded point and the density."""
    width: int = 256
    """Numbers in each."""
    skips: tuple[int, ...] = (5,)
    """Hidden layers, counted from 0, that see the encoded point again."""
    position: Encoding = field(default_factory=Encoding)
    """Encoding of points."""
    direction: Encoding | None = field(default_factory=lambda: Encoding(4))
    """Encoding of viewing directions; None: the colour does not depend on them."""
    view_widths: tuple[int, ...] = (128,)
    """Numbers in each layer that sees the direction; none without directions."""
    linear_first: bool = False
    """The first hidden layer has no relu."""
    feature_relu: bool = False
    """The features of the colour pass through a relu."""


class RadianceMlp(nn.Module):
    """The network; `config` says its shape."""

    def __init__(self, config: MlpConfig) -> None:
        """Weights are torch's defaults until they are loaded or trained."""
        super().__init__()
        self.config = config
        encoded = config.position.width
        inputs = [encoded] + [config.width + encoded * (index in config.skips) for index in range(1, config.depth)]
        self.hidden = nn.ModuleList(nn.Linear(count, config.width) for count in inputs)
        self.density = nn.Linear(config.width, 1)
        widths = (config.width, *config.view_widths)
        if config.direction is not None:
            self.feature = nn.Linear(config.width, config.width)
            seen = [width + config.direction.width * (index == 0) for index, width in enumerate(widths[:-1])]
            self.view = nn.ModuleList(nn.Linear(*pair) for pair in zip(seen, widths[1:], strict=True))
        self.color = nn.Linear(widths[-1] if config.direction is not None else config.width, 3)

    def features(self, points: Points) -> Float[Tensor, "*batch width"]:
        """h, what the network knows of points in its own units."""
        encoded = self.config.position(points)
        hidden = self.hidden[0](encoded)
        hidden = hidden if self.config.linear_first else torch.relu(hidden)
        for index, layer in enumerate(list(self.hidden)[1:], 1):
            known = torch.cat([encoded, hidden], -1) if index in self.config.skips else hidden
            hidden = torch.relu(layer(known))
        return hidden

    def raw_density(self, features: Float[Tensor, "*batch width"]) -> Float[Tensor, "*batch"]:
        """Density before its activation."""
        return self.density(features)[..., 0]

    def colors(self, features: Float[Tensor, "*batch width"], directions: Points) -> Points:
        """Colours in [0, 1] seen along unit viewing directions."""
        if self.config.direction is None:
            return torch.sigmoid(self.color(features))
        described = self.feature(features)
        described = torch.relu(described) if self.config.feature_relu else described
        hidden = torch.cat([described, self.config.direction(directions)], -1)
        for layer in self.view:
            hidden = torch.relu(layer(hidden))
        return torch.sigmoid(self.color(hidden))

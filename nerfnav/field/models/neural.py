"""Neural field (NeRF): a coarse network that places the samples, and a fine one that gives density and colour.

Notation: R, o are the pose of the networks' frame in the world, x = R' (p - o) / unit is a point in their units;
densities per unit become densities per metre, rho(p) = activation(raw(x)) / unit. nerfnav/field/models/mlp.py has
both networks; before training their weights are random (He et al., ICCV 2015).

Rays are sampled in two passes (Mildenhall et al., "NeRF", 2020, section 5.2). The first puts `coarse_bins` bins along
the box and weighs them by the coarse network; the second divides the bins that matter, and their neighbours, into
`fine_per_bin` samples of the fine network. They are evenly spaced, so that a picture is the same each time, and
samples that would come to nothing are left out; training draws at random instead (nerfnav/field/train/neural.py).
"""

import math
from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, field, replace
from enum import Enum

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.field.core.info import FieldInfo
from nerfnav.field.core.protocol import Points, RaySamples, bins_in_box, chosen_samples
from nerfnav.field.models.mlp import MlpConfig, RadianceMlp
from nerfnav.field.render.volume_rendering import Rendering, composite
from nerfnav.geometry import Box, Pose

_POINTS_AT_ONCE = 1 << 15  # activations of a wide network stay in a processor's cache


class Activation(Enum):
    """Function from raw density to density; the value is its name in files."""

    RELU = "relu"
    SOFTPLUS = "softplus"

    def __call__(self, raw: Tensor) -> Tensor:
        """Density per unit of length."""
        return torch.relu(raw) if self is Activation.RELU else torch.nn.functional.softplus(raw - 1)


@dataclass(frozen=True)
class NeuralConfig:
    """Settings of reading two networks as a field."""

    unit: float = 1.0
    """Length of one unit of the networks' space [m]."""
    activation: Activation = Activation.RELU
    """Function that makes raw densities positive."""
    coarse_bins: int = 96
    """Bins along the longest ray through the box."""
    fine_per_bin: int = 6
    """Samples in each bin that matters."""
    least_weight: float = 1e-3
    """Share of a ray's light that a bin must stop to matter."""


@dataclass(frozen=True)
class NeuralField:
    """A coarse and a fine network as one radiance field."""

    box: Box
    """Domain of the field."""
    coarse: RadianceMlp
    """Network that places the samples."""
    fine: RadianceMlp
    """Network that gives density and colour."""
    background: Float[Tensor, "3"]
    """Colour of a ray that nothing stops."""
    frame: Pose
    """T_world_networks: where the networks have their origin [m], and how they are turned."""
    config: NeuralConfig = field(default_factory=NeuralConfig)
    """Units and sampling of the networks."""
    info: FieldInfo = field(default_factory=FieldInfo)
    """Origin and quality of the field."""

    @property
    def step(self) -> float:
        """Distance of samples where they matter [m]."""
        return self._bin / self.config.fine_per_bin

    @property
    def resolution(self) -> float:
        """Distance of samples [m]: networks have no nodes."""
        return self.step

    @property
    def _bin(self) -> float:
        return float(self.box.size.norm()) / self.config.coarse_bins

    def to(self, device: torch.device | str) -> "NeuralField":
        """Copy the networks to a device, without gradients; points and rays may be on any device."""
        coarse, fine = (deepcopy(each).requires_grad_(False).to(device) for each in (self.coarse, self.fine))
        return replace(self, coarse=coarse, fine=fine)

    def density(self, points: Points) -> Float[Tensor, "*batch"]:
        """rho at world points [1/m], differentiable twice; 0 outside the box."""
        return self._density(self.fine, points)

    def radiance(self, points: Points, directions: Points) -> Points:
        """Colour in [0, 1] that points [m] send against unit viewing directions."""

        def colors(at: Tensor, along: Tensor) -> Tensor:
            return self.fine.colors(self.fine.features(self._local(at)), self._turned(along))

        return _in_parts(colors, points.reshape(-1, 3), directions.reshape(-1, 3)).reshape(points.shape)

    @torch.no_grad()
    def samples(self, origins: Float[Tensor, "n 3"], directions: Float[Tensor, "n 3"]) -> RaySamples:
        """The samples of the bins that the coarse network finds light to be stopped in."""
        enter, inside = bins_in_box(self.box, origins, directions, self.step)
        fine, most = self.config.fine_per_bin, inside.shape[1]
        middles = enter[:, None] + (torch.arange(-(-most // fine), device=origins.device) + 0.5) * self._bin
        points = origins[:, None] + middles[..., None] * directions[:, None]
        optical = self._density(self.coarse, points) * self._bin
        before = torch.exp(optical - torch.cumsum(optical, 1))
        weights = before * (1 - torch.exp(-optical))
        matters = torch.nn.functional.max_pool1d(weights[:, None], 3, 1, 1)[:, 0] > self.config.least_weight
        return chosen_samples(matters.repeat_interleave(fine, 1)[:, :most] & inside, enter, self.step)

    @torch.no_grad()
    def render_rays(self, origins: Float[Tensor, "n 3"], directions: Float[Tensor, "n 3"]) -> Rendering:
        """Colours, opacities and depths without gradients; evaluates the network once for each sample."""
        samples = self.samples(origins, directions)
        points = (origins[:, None] + samples.distances[..., None] * directions[:, None])[samples.mask]
        along = directions[:, None].expand(*samples.mask.shape, 3)[samples.mask]

        def both(at: Tensor, viewed: Tensor) -> Tensor:
            density, color = self.seen(self.fine, at, viewed)
            return torch.cat([density[:, None], color], -1)

        found = torch.zeros(*samples.mask.shape, 4, dtype=points.dtype, device=points.device)
        if len(points):
            found[samples.mask] = _in_parts(both, points, along)
        return composite(found[..., 0], found[..., 1:], samples, self.background.to(points))

    def seen(
        self, network: RadianceMlp, points: Points, directions: Points
    ) -> tuple[Float[Tensor, "*batch"], Points]:
        """rho [1/m] and colour by one evaluation of one of the networks, inside the box and outside."""
        features = network.features(self._local(points))
        density = self.config.activation(network.raw_density(features)) / self.config.unit
        return density, network.colors(features, self._turned(directions))

    def _density(self, network: RadianceMlp, points: Points) -> Float[Tensor, "*batch"]:
        flat = points.reshape(-1, 3)
        inside = self.box.contains(flat)

        def at(part: Tensor) -> Tensor:
            return self.config.activation(network.raw_density(network.features(self._local(part))))

        density = _in_parts(at, flat) / self.config.unit
        return torch.where(inside, density, torch.zeros_like(density)).reshape(points.shape[:-1])

    def _local(self, points: Points) -> Points:
        """World points [m] in the networks' space and precision."""
        return self._turned(points - self.frame.position.to(points)) / self.config.unit

    def _turned(self, vectors: Points) -> Points:
        """Directions of the world in the networks' axes and precision."""
        weight = self.fine.density.weight
        return vectors.to(weight) @ self.frame.rotation.to(weight)


def _in_parts(function: Callable[..., Tensor], *rows: Tensor) -> Tensor:
    """`function` of rows, a part at a time, in the precision of the rows."""
    pieces = zip(*(part.split(_POINTS_AT_ONCE) for part in rows), strict=True)
    return torch.cat([function(*piece) for piece in pieces]).to(rows[0])


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

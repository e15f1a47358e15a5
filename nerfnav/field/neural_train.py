"""From posed images to a neural field, as the paper's NeRF was trained: Adam on the colour error of random rays.

Each ray is cut into bins with one random point each for the coarse network; its weights are then a distribution from
which the points of the fine network are drawn, together with the coarse ones. Both networks answer for the colour:

    L = mean |C_coarse - C|^2 + mean |C_fine - C|^2

(Mildenhall et al., "NeRF", ECCV 2020, Eqs. 5 and 6.) Sensible on a GPU, where it takes hours for a picture that the
voxel field of nerfnav/field/train.py has in a minute; on a CPU with small networks and small places.
"""

import math
import time
from collections.abc import Generator
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.compiled import default_threads, threads
from nerfnav.errors import InvalidInputError
from nerfnav.field.calibration import calibrated
from nerfnav.field.field import RaySamples, box_interval
from nerfnav.field.info import FieldInfo
from nerfnav.field.mlp import MlpConfig, RadianceMlp
from nerfnav.field.neural import Activation, NeuralConfig, NeuralField
from nerfnav.field.rays import RayBatch, RaySampler
from nerfnav.field.render import Rendering, composite
from nerfnav.geometry.box import Box
from nerfnav.geometry.camera import Pose
from nerfnav.geometry.images import PosedImages, psnr_db

_FORGET = 0.98  # share of the running error that a step keeps


@dataclass(frozen=True)
class NeuralTrainConfig:
    """How a neural field is trained; the paper's numbers."""

    network: MlpConfig = field(default_factory=MlpConfig)
    """Shape of both networks."""
    iterations: int = 200_000
    """Training steps, when there is no budget."""
    budget: float | None = None
    """Time to spend [s]; replaces `iterations`."""
    rays: int = 1024
    """Rays in a training step."""
    coarse_samples: int = 64
    """Points of the coarse network on each ray."""
    fine_samples: int = 128
    """Points that are drawn where the coarse network found something."""
    rate: float = 5e-4
    """Adam's learning rate at the start."""
    final_rate: float = 0.1
    """What is left of it at the end."""
    report_every: int = 50
    """Training steps between two reports."""


@dataclass(frozen=True)
class NeuralTrainStep:
    """Where training stands."""

    iteration: int
    """Training steps done."""
    fraction: float
    """Share of the training that is done, 0 to 1."""
    psnr_db: float
    """Peak signal-to-noise ratio [dB]: of recent training rays; on the last step, of held-out views."""
    rays_per_s: float
    """Rays learned from in a second, since the start."""
    seconds_left: float
    """Estimated time to the end [s]."""
    field: NeuralField | None = None
    """The trained field, on the CPU; set on the last step."""


def train_neural(
    photographs: PosedImages,
    held_out: PosedImages,
    blank: NeuralField,
    config: NeuralTrainConfig,
    generator: torch.Generator,
) -> Generator[NeuralTrainStep, bool | None, None]:
    """Train the networks of `blank` (see `blank_field`), on the device where they are, and yield progress.

    The last step carries the field. Send True to stop early and keep what was learned. Raises InvalidInputError when
    there is no image.
    """
    if len(photographs) == 0:
        raise InvalidInputError("there is no image to train from; at least two are needed")
    learner = _Learner(blank, config, generator)
    sampler = RaySampler(photographs, generator)
    begun, iteration, fraction, error = time.perf_counter(), 0, 0.0, 0.0
    stop: bool | None = None
    while fraction < 1 and not stop:
        with threads(default_threads()):  # restores how many torch may use, which a parallel kernel forgets
            batch = sampler.draw(config.rays)
        loss = learner.step(batch, config.rate * config.final_rate**fraction)
        error = loss if iteration == 0 else _FORGET * error + (1 - _FORGET) * loss
        iteration += 1
        elapsed = time.perf_counter() - begun
        fraction = min(1.0, iteration / config.iterations if config.budget is None else elapsed / config.budget)
        if iteration % config.report_every == 0 and fraction < 1:
            left = elapsed * (1 - fraction) / fraction
            stop = yield NeuralTrainStep(iteration, fraction, psnr_db(error), iteration * config.rays / elapsed, left)
    info = FieldInfo(
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        images=len(photographs),
        train_s=time.perf_counter() - begun,
        seed=generator.initial_seed(),
        iterations=iteration,
    )
    trained = _judged(replace(blank, info=info), held_out)
    rate = iteration * config.rays / info.train_s
    yield NeuralTrainStep(iteration, fraction, trained.info.psnr_db or psnr_db(error), rate, 0.0, trained)


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


class _Learner:
    """Both networks, Adam's moments and the randomness of the samples."""

    def __init__(self, blank: NeuralField, config: NeuralTrainConfig, generator: torch.Generator) -> None:
        self._field, self._config, self._generator = blank, config, generator
        self._device = blank.fine.density.weight.device
        self._box, self._background = blank.box.to(self._device), blank.background.to(self._device)
        weights = [*blank.coarse.requires_grad_(True).parameters(), *blank.fine.requires_grad_(True).parameters()]
        self._adam = torch.optim.Adam(weights, lr=config.rate)

    def step(self, batch: RayBatch, rate: float) -> float:
        """Learn from some rays; returns the mean squared error of the fine network before that."""
        rays = (batch.origins, batch.directions, batch.targets)
        origins, directions, targets = (torch.from_numpy(part).float().to(self._device) for part in rays)
        enter, leave = box_interval(self._box, origins, directions)
        edges = self._edges(enter, leave)
        distances = edges[:, :-1] + (edges[:, 1:] - edges[:, :-1]) * self._random(len(origins), edges.shape[1] - 1)
        seen, weights = self._look(self._field.coarse, origins, directions, distances, (enter, leave))
        with torch.no_grad():
            drawn = drawn_from(edges, weights, self._random(len(origins), self._config.fine_samples))
            distances = torch.cat([distances, drawn], 1).sort(1).values
        found, _ = self._look(self._field.fine, origins, directions, distances, (enter, leave))
        error = (found.color - targets).square().mean()
        for group in self._adam.param_groups:
            group["lr"] = rate
        self._adam.zero_grad()
        ((seen.color - targets).square().mean() + error).backward()
        self._adam.step()
        return error.item()

    def _edges(self, enter: Float[Tensor, "n"], leave: Float[Tensor, "n"]) -> Float[Tensor, "n k"]:
        """Borders of the coarse bins; rays that miss the box have bins without length."""
        shares = torch.linspace(0, 1, self._config.coarse_samples + 1, device=self._device)
        return enter[:, None] + (leave - enter).clamp_min(0)[:, None] * shares

    def _look(
        self,
        network: RadianceMlp,
        origins: Float[Tensor, "n 3"],
        directions: Float[Tensor, "n 3"],
        distances: Float[Tensor, "n s"],
        interval: tuple[Float[Tensor, "n"], Float[Tensor, "n"]],
    ) -> tuple[Rendering, Float[Tensor, "n s"]]:
        """What a network shows along rays, and the share of the light that each sample stops."""
        points = origins[:, None] + distances[..., None] * directions[:, None]
        density, color = self._field.seen(network, points, directions[:, None].expand_as(points))
        # each sample stands for the ray between the middles to its neighbours
        middles = 0.5 * (distances[:, 1:] + distances[:, :-1])
        enter, leave = (side[:, None] for side in interval)
        ends = torch.cat([enter, middles, leave.maximum(enter)], 1)
        optical = density * (ends[:, 1:] - ends[:, :-1]).clamp_min(0)
        samples = RaySamples(distances, torch.ones_like(distances, dtype=torch.bool), 1.0)
        with torch.no_grad():
            weights = torch.exp(optical - optical.cumsum(1)) * (1 - torch.exp(-optical))
        return composite(optical, color, samples, self._background), weights

    def _random(self, *shape: int) -> Tensor:
        return torch.rand(*shape, generator=self._generator).to(self._device)


def drawn_from(
    edges: Float[Tensor, "n k"], weights: Float[Tensor, "n b"], shares: Float[Tensor, "n s"]
) -> Float[Tensor, "n s"]:
    """Distances at which the distribution with `weights` on the bins between `edges` has reached `shares` of itself."""
    total = torch.cumsum(weights + 1e-5, 1)
    reached = torch.cat([torch.zeros_like(total[:, :1]), total / total[:, -1:]], 1)
    bins = (torch.searchsorted(reached, shares.contiguous(), right=True) - 1).clamp(0, weights.shape[1] - 1)
    low, high = torch.gather(reached, 1, bins), torch.gather(reached, 1, bins + 1)
    start, end = torch.gather(edges, 1, bins), torch.gather(edges, 1, bins + 1)
    return start + (end - start) * ((shares - low) / (high - low).clamp_min(1e-9)).clamp(0, 1)


def _judged(trained: NeuralField, held_out: PosedImages) -> NeuralField:
    """The field on the CPU, with what views that it was not trained on say about it."""
    coarse, fine = trained.coarse.requires_grad_(False).cpu(), trained.fine.requires_grad_(False).cpu()
    trained = replace(trained, coarse=coarse, fine=fine)
    return replace(trained, info=calibrated(trained.info, trained, held_out))


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

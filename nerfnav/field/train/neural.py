"""Neural field training, as the paper's NeRF was trained: Adam on the colour error of random rays of posed images.

Each ray is cut into bins with one random point each for the coarse network; its weights are then a distribution from
which the points of the fine network are drawn, together with the coarse ones. Both networks answer for the colour:

    L = mean |C_coarse - C|^2 + mean |C_fine - C|^2

(Mildenhall et al., "NeRF", ECCV 2020, Eqs. 5 and 6.) Sensible on a GPU, where it takes hours for a picture that the
voxel field of nerfnav/field/train/loop.py has in a minute; on a CPU with small networks and small places.
"""

from collections.abc import Generator
from dataclasses import dataclass, field, replace

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.deadline import Deadline
from nerfnav.core.errors import InvalidInputError
from nerfnav.core.jit import default_threads, threads
from nerfnav.field.core.protocol import RaySamples, box_interval
from nerfnav.field.models.mlp import MlpConfig, RadianceMlp
from nerfnav.field.models.neural import NeuralField
from nerfnav.field.render.volume_rendering import Rendering, composite
from nerfnav.field.train.evaluation import calibrate_noise, describe_training, predict_noise_s
from nerfnav.field.train.progress import Progress, TrainStep
from nerfnav.field.train.rays import RayBatch, RaySampler
from nerfnav.geometry import PosedImages


@dataclass(frozen=True)
class NeuralTrainConfig:
    """Settings of training a neural field; the paper's numbers."""

    network: MlpConfig = field(default_factory=MlpConfig)
    """Shape of both networks."""
    iterations: int = 200_000
    """Training steps, when there is no budget."""
    budget: float | None = None
    """Wall time to spend, evaluation included [s]; replaces `iterations`."""
    rays: int = 1024
    """Rays in a training step."""
    coarse_samples: int = 64
    """Points of the coarse network on each ray."""
    fine_samples: int = 128
    """Points that are drawn where the coarse network found something."""
    rate: float = 5e-4
    """Adam's learning rate at the start."""
    final_rate: float = 0.1
    """Share of the learning rate that is left at the end."""
    report_every: int = 50
    """Training steps between two reports."""


class NeuralLearner:
    """Both networks, Adam's moments and the randomness of the samples."""

    def __init__(self, blank: NeuralField, config: NeuralTrainConfig, generator: torch.Generator) -> None:
        self._field, self._config, self._generator = blank, config, generator
        self._device = blank.fine.density.weight.device
        self._box, self._background = blank.box.to(self._device), blank.background.to(self._device)
        weights = [*blank.coarse.requires_grad_(True).parameters(), *blank.fine.requires_grad_(True).parameters()]
        self._adam = torch.optim.Adam(weights, lr=config.rate)

    def step(self, batch: RayBatch, rate: float) -> float:
        """Learn from some rays; returns the mean squared error of the fine network before that."""
        origins, directions, targets = (
            torch.from_numpy(part).float().to(self._device)
            for part in (batch.origins, batch.directions, batch.targets)
        )
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
        """Render rays by one network; returns also the share of the light that each sample stops."""
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


def train_neural(
    photographs: PosedImages,
    held_out: PosedImages,
    blank: NeuralField,
    config: NeuralTrainConfig,
    generator: torch.Generator,
) -> Generator[TrainStep, bool | None, NeuralField]:
    """Train the networks of `blank` (see `blank_field`), and return the field, both on their device.

    Its evaluation takes minutes on a CPU and seconds on a GPU. Yields progress. Send True to stop early and keep what
    was learned. Raises InvalidInputError when there is no image.
    """
    if len(photographs) == 0:
        raise InvalidInputError("there is no image to train from; at least two are needed")
    learner = NeuralLearner(blank, config, generator)
    sampler = RaySampler(photographs, generator)
    progress = Progress(config.iterations, Deadline(config.budget))
    stop: bool | None = None
    while progress.fraction < 1 and not stop:
        with threads(default_threads()):  # restores how many torch may use, which a parallel kernel forgets
            batch = sampler.draw(config.rays)
        progress.learned(learner.step(batch, config.rate * config.final_rate**progress.fraction), config.rays)
        if progress.has_budget and progress.iteration == 1:
            progress.reserve(predict_noise_s(blank, held_out))
        if progress.is_due(config.report_every):
            stop = yield progress.step()
    info = replace(describe_training(photographs, generator, progress.iteration), train_s=progress.elapsed_s)
    trained = blank.to(blank.fine.density.weight.device)
    trained = replace(trained, info=calibrate_noise(info, trained, held_out))
    rate, psnr = progress.iteration * config.rays / info.train_s, trained.info.psnr_db or progress.psnr_db
    yield progress.last_step(psnr, rate)
    return trained

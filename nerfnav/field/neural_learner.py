"""Learner of a neural field: one step of Adam on both networks."""

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.field.field import RaySamples, box_interval
from nerfnav.field.mlp import RadianceMlp
from nerfnav.field.neural import NeuralField
from nerfnav.field.neural_train_config import NeuralTrainConfig
from nerfnav.field.rays import RayBatch
from nerfnav.field.render import Rendering, composite


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

"""Grid learner in torch, on any device: what `GridLearner` does with compiled kernels, by autograd, for GPUs.

Both learn the same: samples, losses, Adam and its resting nodes are those of kernels/learn.py, and the tests compare
a step. Numbers are added up in another order here, so results agree to rounding, not bit for bit.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from nerfnav.field.core.occupancy import DENSITY_SCALE
from nerfnav.field.core.protocol import RaySamples, bins_in_box, box_interval
from nerfnav.field.kernels import adam, learn
from nerfnav.field.models.voxel import VoxelField, occupied_blocks
from nerfnav.field.render.surroundings import Surroundings
from nerfnav.field.render.volume_rendering import composite, over
from nerfnav.field.train.grid_learner import (
    BAND,
    ROUGHNESS_EVERY,
    GridLearner,
    LearningRates,
    dense_blocks,
    is_pruning_due,
    occupied_above,
)
from nerfnav.field.train.rays import PointBatch, RayBatch
from nerfnav.field.train.trained_grid import TrainedGrid, refined
from nerfnav.field.train.training_volume import VALUE_BOUNDS, Finish, TrainingVolume, finish_densities, finish_field
from nerfnav.geometry import dilate_nodes, spacing_of, trilinear

Values = Float[Tensor, "nx ny nz 4"]
_SHELL_JITTER = 0.98  # as the kernel: the last shell must stay this side of infinity


class TorchGrid:
    """Node values with Adam's moments: twin of `TrainedGrid`."""

    def __init__(self, values: Values, rate_scale: Float[Tensor, "nx ny nz"]) -> None:
        """Learn `values`, on their device, with densities at rates times `rate_scale`."""
        self.values, self.rate_scale = values, rate_scale
        self._bounds = VALUE_BOUNDS.to(values.device)
        self._first, self._second = torch.zeros_like(values), torch.zeros_like(values)
        self._steps = 0

    @classmethod
    def of(cls, grid: TrainedGrid, device: torch.device) -> "TorchGrid":
        """The same grid on a device, with nothing learned yet."""
        return cls(*(torch.from_numpy(part.copy()).to(device) for part in (grid.values, grid.rate_scale)))

    def refined(self, shape: tuple[int, int, int]) -> "TorchGrid":
        """The same values between more nodes."""
        return TorchGrid(refined(self.values, shape), refined(self.rate_scale[..., None], shape)[..., 0])

    @torch.no_grad()
    def descend(self, gradient: Values, rates: LearningRates) -> None:
        """A step of Adam on the nodes that have a gradient."""
        self._steps += 1
        moving = gradient != 0
        mean = torch.lerp(self._first, gradient, float(1 - adam.FIRST))
        square = torch.lerp(self._second, gradient.square(), float(1 - adam.SECOND))
        self._first = torch.where(moving, mean, self._first)
        self._second = torch.where(moving, square, self._second)
        size = (square / (1 - float(adam.SECOND) ** self._steps)).sqrt() + 1e-15
        rate = torch.full_like(gradient, rates.color)
        rate[..., 0] = rates.density * self.rate_scale
        moved = self.values - rate * mean / (1 - float(adam.FIRST) ** self._steps) / size
        bounded = torch.minimum(torch.maximum(moved, self._bounds[0]), self._bounds[1])
        self.values = torch.where(moving, bounded, self.values)

    @torch.no_grad()
    def roughness(self, gradient: Values, density_weight: float, color_weight: float) -> Values:
        """The gradient of the roughness of all nodes that `gradient` moves (see `adam.add_roughness`)."""
        weights = torch.tensor([density_weight, *[color_weight] * 3], device=gradient.device)
        pull = torch.zeros_like(gradient)
        for axis in range(3):
            step = self.values.diff(dim=axis).clamp(-1, 1)
            pull.narrow(axis, 0, step.shape[axis]).sub_(step)
            pull.narrow(axis, 1, step.shape[axis]).add_(step)
        return torch.where(gradient != 0, weights * pull, torch.zeros_like(pull))


class TorchLearner:
    """Trains the values of the box, and of its surroundings where there are any, on one device."""

    def __init__(
        self, place: TrainingVolume, inner: TorchGrid, outer: TorchGrid | None, allowed: Bool[Tensor, "bx by bz"]
    ) -> None:
        """Train `inner`, in blocks that are `allowed`, and `outer`, all on one device."""
        self.place, self.inner, self.outer = place, inner, outer
        self._grids = [inner] if outer is None else [inner, outer]
        self._device = inner.values.device
        self._box, self._background = place.box.to(self._device), place.background.to(self._device)
        nx, ny, nz, _ = inner.values.shape
        parts = allowed.to(self._device)
        for axis, count in enumerate((nx, ny, nz)):
            parts = parts.repeat_interleave(2, axis).narrow(axis, 0, -(-count // 2))
        self.parts = self._allowed = parts
        """Parts of 2 x 2 x 2 cells that are sampled (see kernels/learn.py)."""
        self._sample_step = 0.5 * float(spacing_of(place.box, (nx, ny, nz)).min())
        self._steps, self._firm = 0, False

    @classmethod
    def of(cls, learner: GridLearner, device: torch.device) -> "TorchLearner":
        """Copy of a learner on the CPU, on another device."""
        outer = TorchGrid.of(learner.outer, device) if learner.outer.values.size else None
        return cls(
            learner.place, TorchGrid.of(learner.inner, device), outer, torch.from_numpy(learner.occupied > 0)
        )

    def refined(self, shape: tuple[int, int, int], outside: int = 0) -> "TorchLearner":
        """The same field on finer grids."""
        inner, outer = self.inner.refined(shape), self.outer
        if outer is not None and outside > outer.values.shape[0]:
            outer = outer.refined((outside, outside, outside))
        return TorchLearner(self.place, inner, outer, dilate_nodes(dense_blocks(inner.values, self.place)))

    def gradient(self, batch: RayBatch, sparsity: float) -> tuple[float, list[Tensor]]:
        """The mean squared colour error of a batch, and the gradients of its sum: of the box, of what is around it."""
        leaves = [grid.values.detach().requires_grad_() for grid in self._grids]
        error, thickness = self._errors(batch, leaves)
        gradients = torch.autograd.grad(error + sparsity * thickness, leaves)
        return float(error.detach()) / (3 * len(batch.targets)), list(gradients)

    def points_gradient(self, batch: PointBatch) -> Tensor:
        """The box's gradient of the likelihood that rays end at points (see kernels/learn.py)."""
        leaf, step = self.inner.values.detach().requires_grad_(), self._sample_step
        origins, directions, jitter, distances = (
            torch.from_numpy(array).to(self._device)
            for array in (batch.origins, batch.directions, batch.jitter, batch.distances)
        )
        samples = self._samples(origins, directions, jitter)
        density, _ = self._mixed(leaf, origins, directions, samples)
        enter, leave = box_interval(self._box, origins, directions)
        enter = enter + jitter * step
        most, reach = ((leave - enter) / step).floor(), 2 * BAND * step
        first = torch.minimum(((distances - reach - enter) / step).floor().clamp_min(0), most)[:, None]
        behind = torch.minimum(((distances + reach - enter) / step).ceil(), most)[:, None]
        index, inside = torch.arange(density.shape[1], device=self._device), behind > first
        clear, through = (
            torch.exp(-step * _learned(torch.where(inside & part, density, 0.0), step).sum(1))
            for part in (index < first, (index >= first) & (index < behind))
        )
        loss = -torch.log(clear * (1 - through) + float(learn.CHANCE)).sum()
        return torch.autograd.grad(loss, leaf)[0]

    def step(self, batch: RayBatch, rates: LearningRates, points: PointBatch | None = None) -> float:
        """Learn from a batch of rays, and from points; returns the mean squared colour error before the step."""
        if is_pruning_due(self._steps):
            self.prune_empty_blocks()
        error, gradients = self.gradient(batch, rates.sparsity)
        if points is not None and rates.points:
            gradients[0] = gradients[0] + rates.points * self.points_gradient(points)
        for grid, gradient in zip(self._grids, gradients, strict=True):
            if self._steps % ROUGHNESS_EVERY == 0 and (rates.rough_density or rates.rough_color):
                much = ROUGHNESS_EVERY * 3 * len(batch.targets)
                gradient = gradient + grid.roughness(gradient, much * rates.rough_density, much * rates.rough_color)
            grid.descend(gradient, rates)
        self._steps += 1
        return error

    def prune_empty_blocks(self) -> None:
        """Skip what has become empty."""
        self.parts = occupied_blocks(self.inner.values[..., 0], occupied_above(self.place), 1) & self._allowed

    @torch.no_grad()
    def colors(self, batch: RayBatch) -> Float[Tensor, "n 3"]:
        """Render rays in the grid as it is learned so far; the result is on the CPU."""
        return self._seen(batch, [grid.values for grid in self._grids])[0].cpu()

    def firm(self, finish: Finish) -> None:
        """Give the densities their last values, once (see `GridLearner.firm`)."""
        if not self._firm:
            finish_densities(self.place, self.inner.values, self._blocks, finish)
            self.prune_empty_blocks()
        self._firm = True

    def so_far(self, finish: Finish) -> VoxelField:
        """Finished copy of the field so far, on the CPU (see `GridLearner.so_far`)."""
        values, outer = self.inner.values.cpu().clone(), None if self.outer is None else self.outer.values.cpu().clone()
        if not self._firm:
            finish_densities(self.place, values, self._blocks.cpu(), finish)
        return finish_field(self.place, values, outer)

    def field(self, finish: Finish) -> VoxelField:
        """Finished field, on the CPU (see `GridLearner.field`)."""
        return self.so_far(finish)

    @property
    def _blocks(self) -> Bool[Tensor, "bx by bz"]:
        """Blocks of which a part is sampled."""
        return torch.nn.functional.max_pool3d(self.parts[None].float(), 2, ceil_mode=True)[0] > 0

    def _errors(self, batch: RayBatch, leaves: list[Tensor]) -> tuple[Tensor, Tensor]:
        """Summed squared colour error, and the integral of log(1 + 2 rho^2) along the rays, rho in 1 / unit."""
        targets = torch.from_numpy(batch.targets).to(self._device)
        seen, density, step = self._seen(batch, leaves)
        unit = self.place.unit
        thickness = torch.log1p(2 * (unit * density).square()).sum() * (step / unit)
        return (seen - targets).square().sum(), thickness

    def _seen(self, batch: RayBatch, leaves: list[Tensor]) -> tuple[Tensor, Tensor, float]:
        """Colours (n, 3) of rays, the densities of their samples, and how far apart these are [m]."""
        origins, directions, jitter = (
            torch.from_numpy(array).to(self._device) for array in (batch.origins, batch.directions, batch.jitter)
        )
        samples = self._samples(origins, directions, jitter)
        density, color = self._mixed(leaves[0], origins, directions, samples)
        density = _learned(density, samples.step)
        if len(leaves) == 1:
            seen = composite(density, color, samples, self._background).color
        else:
            front = composite(density, color, samples, torch.zeros_like(self._background))
            behind = Surroundings(leaves[1]).backdrop(self._box, origins, directions, _SHELL_JITTER * jitter)
            seen = over(front, behind, self._background).color
        return seen, density, samples.step

    def _mixed(
        self, leaf: Tensor, origins: Tensor, directions: Tensor, samples: RaySamples
    ) -> tuple[Tensor, Tensor]:
        """Densities (n, samples) and colours (n, samples, 3) between the nodes of the box; 0 in empty parts."""
        points = (origins[:, None] + samples.distances[..., None] * directions[:, None])[samples.mask]
        mixed = trilinear(leaf, self._box, points)
        density = origins.new_zeros(samples.mask.shape)
        density[samples.mask] = DENSITY_SCALE * torch.nn.functional.softplus(mixed[:, 0])
        color = origins.new_zeros(*samples.mask.shape, 3)
        color[samples.mask] = mixed[:, 1:]
        return density, color

    def _samples(self, origins: Tensor, directions: Tensor, jitter: Tensor) -> RaySamples:
        """A sample every half voxel in the parts that are sampled."""
        step = self._sample_step
        enter, inside = bins_in_box(self._box, origins, directions, step)
        index = torch.arange(inside.shape[1], device=self._device)
        distances = (enter + jitter * step)[:, None] + (index + 0.5) * step
        points = origins[:, None] + distances[..., None] * directions[:, None]
        shape = torch.tensor(self.inner.values.shape[:3], device=self._device)
        cell = ((points - self._box.lower) / self._box.size * (shape - 1)).long()
        x, y, z = (torch.minimum(cell.clamp_min(0), shape - 2) // 2).unbind(-1)
        return RaySamples(distances, inside & self.parts[x, y, z], step)


def _learned(density: Float[Tensor, "n samples"], step: float) -> Float[Tensor, "n samples"]:
    """Densities of samples that stop light worth learning from, 0 for the others."""
    depth = step * density.detach()
    depth = torch.where(-torch.expm1(-depth) < float(learn.FAINT), 0.0, depth)
    light = torch.exp(depth - depth.cumsum(1))
    return torch.where((depth > 0) & (light > float(learn.DARK)), density, 0.0)

"""Grid learner on CPU kernels: the state of training at one resolution (box, surroundings, occupancy)."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from nerfnav.field.core.occupancy import DENSITY_SCALE, EMPTY_RAW, raw_of
from nerfnav.field.kernels import learn, march
from nerfnav.field.kernels.shells import whole_shells
from nerfnav.field.models.grid_field import grey_nodes
from nerfnav.field.models.voxel import VoxelField, occupied_blocks
from nerfnav.field.proof.fusion import FusedDepth
from nerfnav.field.train.rays import PointBatch, RayBatch
from nerfnav.field.train.trained_grid import TrainedGrid, all_blocks, clear_around, views_of_nodes
from nerfnav.field.train.training_volume import Finish, TrainingVolume, finish_densities, finish_field
from nerfnav.geometry import PosedImages, dilate_nodes, spacing_of

_START_DENSITY = 0.0814  # [1/unit]: the box is nearly clear at first
_START_IN_HULL = 0.45  # [1/unit]: a fifth of the light is stopped in half a unit; what no ray teaches ends empty
_OCCUPIED_ABOVE = 0.02  # [1/unit]: thinner space is skipped in training
_OCCUPANCY_EVERY = 64  # steps between two prunings of empty blocks
_OCCUPANCY_FROM = 128  # steps of a stage before the first pruning
ROUGHNESS_EVERY = 2
"""Steps between two gradients of the roughness of the grids."""
BAND = 1.5
"""Half width of the band around a sparse point in which its ray may end [distances of nodes]."""


@dataclass(frozen=True)
class LearningRates:
    """Learning rates and loss weights of one step."""

    density: float
    """Adam's learning rate of raw densities."""
    color: float
    """Adam's learning rate of colours."""
    sparsity: float
    """Weight of thin density along rays."""
    rough_density: float = 0.0
    """Weight of the differences of neighbours' raw densities, against the mean squared error."""
    rough_color: float = 0.0
    """The same of their colours."""
    points: float = 0.0
    """Weight of the likelihood that rays to points which photographs show end there."""


class GridLearner:
    """Trains the values of the box, and of its surroundings where there are any."""

    def __init__(
        self,
        place: TrainingVolume,
        inner: TrainedGrid,
        outer: TrainedGrid,
        near: Bool[Tensor, "bx by bz"] | None = None,
    ) -> None:
        """Train `inner` in the box, in the blocks `near` or in all, and `outer`, which may have no nodes, around it."""
        self.place, self.inner, self.outer = place, inner, outer
        near = all_blocks(inner.shape) if near is None else near
        self.occupied = np.where(near.numpy(), learn.ALL_PARTS, 0).astype(np.uint8)
        self._lower = place.box.lower.numpy().astype(np.float32)
        spacing = spacing_of(place.box, inner.shape)
        self._per_meter = (1 / spacing).numpy().astype(np.float32)
        self.sample_step = 0.5 * float(spacing.min())
        self._table = learn.depth_table(DENSITY_SCALE, self.sample_step, place.unit)
        self._steps, self._firm = 0, False

    @classmethod
    def start(
        cls,
        place: TrainingVolume,
        shape: tuple[int, int, int],
        photographs: PosedImages,
        workers: int,
        outside: int = 0,
    ) -> "GridLearner":
        """A nearly clear grey box, with a grid of `outside`^3 nodes around it; 0 for a plain background."""
        grey = grey_nodes(shape, raw_of(_START_DENSITY / place.unit))
        return cls._begin(place, grey, photographs, workers, outside)

    @classmethod
    def in_hull(
        cls, place: TrainingVolume, hull: Bool[Tensor, "nx ny nz"], photographs: PosedImages, workers: int
    ) -> "GridLearner":
        """Thicker fog in the nodes of a visual hull, and nothing elsewhere: there is nothing to learn there."""
        values = grey_nodes(hull.shape, EMPTY_RAW)
        values[..., 0][hull] = raw_of(_START_IN_HULL / place.unit)
        return cls._begin(place, values, photographs, workers, near=dense_blocks(values, place))

    @classmethod
    def from_depth(
        cls, place: TrainingVolume, depth: FusedDepth, photographs: PosedImages, workers: int, outside: int = 0
    ) -> "GridLearner":
        """Start from fused depth: densities that depth gives stay fixed, colours and all other nodes are learned.

        What depth does not show begins empty: as thin fog, it would come to stand for what surroundings should show.
        """
        values = grey_nodes(depth.raw.shape, EMPTY_RAW)
        values[..., 0] = torch.where(depth.known, depth.raw, values[..., 0])
        values[..., 1:] = depth.color
        near = dilate_nodes(dense_blocks(values, place))
        return cls._begin(place, values, photographs, workers, outside, near, depth.known)

    @classmethod
    def _begin(
        cls,
        place: TrainingVolume,
        values: Float[Tensor, "nx ny nz 4"],
        photographs: PosedImages,
        workers: int,
        outside: int = 0,
        near: Bool[Tensor, "bx by bz"] | None = None,
        fixed: Bool[Tensor, "nx ny nz"] | None = None,
    ) -> "GridLearner":
        """Learn from `values`: densities at rates by how many cameras see them, and never those that are `fixed`."""
        nx, ny, nz, _ = values.shape
        rates = views_of_nodes(place.box, (nx, ny, nz), photographs)
        if fixed is not None:
            rates = torch.where(fixed, 0.0, rates)
        inner = TrainedGrid(values, rates, workers, near)
        return cls(place, inner, clear_around(place, photographs, outside, workers), near)

    @classmethod
    def of(cls, field: VoxelField, unit: float, workers: int) -> "GridLearner":
        """Learn on from a field, with all its nodes at the full rate, where it has density."""
        inner = TrainedGrid(field.values, torch.ones(field.shape), workers, field.occupied)
        outer = TrainedGrid.nothing(workers)
        if field.outside is not None:
            outer = TrainedGrid(field.outside.values, torch.ones_like(field.outside.values[..., 0]), workers)
        return cls(TrainingVolume(field.box, field.background, unit), inner, outer, field.occupied)

    def refined(self, shape: tuple[int, int, int], outside: int = 0) -> "GridLearner":
        """The same field on finer grids. Empty blocks that touch no other stay empty."""
        workers = self.inner.gradients.shape[0]
        values, scale = self.inner.refined(shape)
        near = dilate_nodes(dense_blocks(values, self.place))
        inner, outer = TrainedGrid(values, scale, workers, near), self.outer
        if outside > outer.shape[0] > 0:
            outer = TrainedGrid(*outer.refined((outside, outside, outside)), workers)
        return GridLearner(self.place, inner, outer, near)

    def gradient(self, batch: RayBatch, sparsity: float) -> float:
        """Add up the gradient of a batch of rays; returns its mean squared colour error."""
        inner, outer = self.inner, self.outer
        errors = learn.loss_and_gradient(
            (inner.values, self.occupied, self._lower, self._per_meter),
            (batch.origins, batch.directions, batch.jitter, batch.targets),
            (np.float32(self.sample_step), np.float32(sparsity), self._table),
            self.place.background.numpy(),
            (inner.slots, inner.gradients, inner.touched),
            (outer.values, outer.slots, outer.gradients, outer.touched),
        )
        return float(errors.sum(dtype=np.float64)) / (3 * len(batch.targets))

    def add_points(self, batch: PointBatch, weight: float) -> None:
        """Add to the gradient that of the likelihood with which rays end at the points that they lead to."""
        inner = self.inner
        learn.seen_points_gradient(
            (inner.values, self.occupied, self._lower, self._per_meter),
            (batch.origins, batch.directions, batch.jitter, batch.distances),
            (np.float32(self.sample_step), np.float32(2 * BAND * self.sample_step), np.float32(weight), self._table),
            (inner.slots, inner.gradients, inner.touched),
        )

    def step(self, batch: RayBatch, rates: LearningRates, points: PointBatch | None = None) -> float:
        """Learn from a batch of rays, and from points; returns the mean squared colour error before the step."""
        if is_pruning_due(self._steps):
            self.prune_empty_blocks()
        error = self.gradient(batch, rates.sparsity)
        if points is not None and rates.points:
            self.add_points(points, rates.points)
        grids = (self.inner, self.outer) if self.outer.values.size else (self.inner,)
        for grid in grids:
            if self._steps % ROUGHNESS_EVERY == 0 and (rates.rough_density or rates.rough_color):
                much = ROUGHNESS_EVERY * 3 * len(batch.targets)  # errors are summed over rays and channels
                grid.smooth(much * rates.rough_density, much * rates.rough_color)
            grid.descend(rates.density, rates.color)
        self._steps += 1
        return error

    def prune_empty_blocks(self) -> None:
        """Skip what has become empty; blocks without a slot have nothing to learn in."""
        learn.parts_above(
            self.inner.values, self.inner.slots, np.float32(occupied_above(self.place)), self.occupied
        )  # fmt: skip

    def colors(self, batch: RayBatch) -> Float[Tensor, "n 3"]:
        """Render rays in the grid as it is learned so far."""
        seen, *_ = march.render(
            self.inner.values, self.occupied, self._lower, self._per_meter, batch.origins, batch.directions,
            np.float32(DENSITY_SCALE), np.float32(self.sample_step), self.place.background.numpy(),
            whole_shells(self.outer.values),
        )  # fmt: skip
        return torch.from_numpy(seen)

    def firm(self, finish: Finish) -> None:
        """Give the densities their last values, once; from then on there are only colours to learn."""
        if not self._firm:
            values, occupied = torch.from_numpy(self.inner.values), torch.from_numpy(self.occupied > 0)
            finish_densities(self.place, values, occupied, finish)
            self.prune_empty_blocks()
        self._firm = True

    def so_far(self, finish: Finish) -> VoxelField:
        """Finished copy of the field as it is learned so far; learning goes on."""
        values, outer = torch.from_numpy(self.inner.values.copy()), self.outer.values
        if not self._firm:
            finish_densities(self.place, values, torch.from_numpy(self.occupied > 0), finish)
        return finish_field(self.place, values, torch.from_numpy(outer.copy()) if outer.size else None)

    def field(self, finish: Finish) -> VoxelField:
        """Finished field; blocks outside the occupied ones are empty. The learner cannot be used afterwards."""
        self.firm(finish)
        outer = self.outer.released() if self.outer.values.size else None
        return finish_field(self.place, self.inner.released(), outer)


def is_pruning_due(step: int) -> bool:
    """Check that pruning is due, so many steps after the stage began."""
    return step >= _OCCUPANCY_FROM and step % _OCCUPANCY_EVERY == 0


def dense_blocks(values: Float[Tensor, "nx ny nz 4"], place: TrainingVolume) -> Bool[Tensor, "bx by bz"]:
    """Blocks with enough density to be sampled in training."""
    return occupied_blocks(values[..., 0], occupied_above(place))


def occupied_above(place: TrainingVolume) -> float:
    """Raw density above which space is sampled in training."""
    return raw_of(_OCCUPIED_ABOVE / place.unit)

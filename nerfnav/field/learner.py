"""The state of training at one resolution: values, Adam's moments, gradients and occupancy, all in numpy."""

import math

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.field.kernels import learn
from nerfnav.field.rays import RayBatch
from nerfnav.field.voxel import DENSITY_SCALE, EMPTY_RAW, VoxelField, occupied_blocks
from nerfnav.geometry.box import Box
from nerfnav.geometry.grid import node_positions, spacing_of
from nerfnav.geometry.images import PosedImages

_START_RAW = -8.5  # rho = 0.08 / m: the box is nearly clear at first
_BOUNDS = np.array([[EMPTY_RAW, 0.0, 0.0, 0.0], [2.0, 1.0, 1.0, 1.0]], np.float32)
_OCCUPIED_ABOVE = 0.02  # [1/m]: what is thinner is skipped in training
_OCCUPANCY_EVERY = 64  # steps between two looks at what is empty
_OCCUPANCY_FROM = 128  # steps of a stage before the first look


class GridLearner:
    """Trains the values of one grid."""

    def __init__(
        self,
        box: Box,
        values: Float[Tensor, "nx ny nz 4"],
        background: Float[Tensor, "3"],
        photographs: PosedImages,
        workers: int,
    ) -> None:
        """Start from `values`; `workers` is the number of threads, each with gradients of its own."""
        self.box, self.background, self.workers = box, background, workers
        self.values = np.ascontiguousarray(values.numpy(), np.float32)
        shape = self.values.shape
        nx, ny, nz, _ = shape
        self._rate_scale = views_of_nodes(box, (nx, ny, nz), photographs).numpy()
        self._occupied = np.ones([-(-count // 4) for count in shape[:3]], np.uint8)
        self._gradients = np.zeros((workers, *shape), np.float32)
        self._touched = np.zeros((workers, *self._occupied.shape), np.uint8)
        self._first, self._second = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
        self._lower = box.lower.numpy().astype(np.float32)
        spacing = spacing_of(box, (nx, ny, nz))
        self._per_meter = (1 / spacing).numpy().astype(np.float32)
        self._step = np.float32(0.5 * float(spacing.min()))
        self._steps = 0

    @classmethod
    def start(
        cls,
        box: Box,
        shape: tuple[int, int, int],
        background: Float[Tensor, "3"],
        photographs: PosedImages,
        workers: int,
    ) -> "GridLearner":
        """A nearly clear grey box."""
        values = torch.full((*shape, 4), 0.5)
        values[..., 0] = _START_RAW
        return cls(box, values, background, photographs, workers)

    def refined(self, shape: tuple[int, int, int], photographs: PosedImages) -> "GridLearner":
        """The same field on a finer grid."""
        coarse = torch.from_numpy(self.values).permute(3, 0, 1, 2)[None]
        fine = torch.nn.functional.interpolate(coarse, shape, mode="trilinear", align_corners=True)
        values = fine[0].permute(1, 2, 3, 0).contiguous()
        return GridLearner(self.box, values, self.background, photographs, self.workers)

    def step(self, batch: RayBatch, density_rate: float, color_rate: float, sparsity: float) -> float:
        """Learn from a batch of rays; returns the mean squared colour error before the step.

        The rates are Adam's learning rates of raw density and colour, `sparsity` weighs thin density along rays.
        """
        if self._steps >= _OCCUPANCY_FROM and self._steps % _OCCUPANCY_EVERY == 0:
            self._look_for_empty_blocks()
        errors = learn.loss_and_gradient(
            self.values, self._occupied, self._lower, self._per_meter, batch.origins, batch.directions,
            batch.jitter, batch.targets, np.float32(DENSITY_SCALE), self._step, self.background.numpy(),
            np.float32(sparsity), self._gradients, self._touched,
        )  # fmt: skip
        count = len(batch.targets)
        self._steps += 1
        corrections = np.array([1 - learn.FIRST**self._steps, 1 - learn.SECOND**self._steps], np.float32)
        learn.adam(
            self.values, self._gradients, self._touched, self._first, self._second,
            np.array([density_rate, *[color_rate] * 3], np.float32), self._rate_scale, _BOUNDS, corrections,
        )  # fmt: skip
        return float(errors.sum(dtype=np.float64)) / (3 * count)

    def field(self, empty_below: float) -> VoxelField:
        """What was learned, with nodes thinner than `empty_below` [1/m] and untrained blocks emptied."""
        values = torch.from_numpy(self.values.copy())
        raw = values[..., 0]
        hidden = torch.from_numpy(self._occupied == 0)
        for axis in range(3):
            hidden = hidden.repeat_interleave(4, axis)
        nx, ny, nz = raw.shape
        thin = (raw < _raw_of(empty_below)) | hidden[:nx, :ny, :nz]
        values[..., 0] = torch.where(thin, torch.full_like(raw, EMPTY_RAW), raw)
        return VoxelField(self.box, values, self.background)

    def _look_for_empty_blocks(self) -> None:
        raw = torch.from_numpy(self.values[..., 0])
        self._occupied = occupied_blocks(raw, _raw_of(_OCCUPIED_ABOVE)).numpy().astype(np.uint8)


def views_of_nodes(
    box: Box, shape: tuple[int, int, int], photographs: PosedImages
) -> Float[Tensor, "nx ny nz"]:
    """The share of cameras, relative to the best seen node, whose picture contains each node (walls ignored)."""
    camera = photographs.camera
    points = node_positions(box, shape).reshape(-1, 3)
    seen = torch.zeros(len(points))
    for index in range(len(photographs)):
        pose = photographs.poses[index]
        in_camera = (points - pose.position) @ pose.rotation
        depth = (-in_camera[:, 2]).clamp_min(1e-3)
        u = camera.cx + camera.fx * in_camera[:, 0] / depth
        v = camera.cy - camera.fy * in_camera[:, 1] / depth
        inside = (in_camera[:, 2] < -1e-3) & (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
        seen += inside
    return (seen / seen.max().clamp_min(1)).reshape(shape)


def _raw_of(density: float) -> float:
    """The raw value that stands for a density [1/m]: the inverse of scale * softplus."""
    return math.log(math.expm1(density / DENSITY_SCALE))

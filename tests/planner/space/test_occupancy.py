"""Dense cells of a grid on a map's columns: what is marked in one go is what each cell would mark by itself."""

import math

import numpy as np
import pytest
import torch

from nerfnav.field.core.occupancy import EMPTY_RAW
from nerfnav.field.models.bricks import convert_to_bricks
from nerfnav.field.models.voxel import VoxelField
from nerfnav.geometry.box import Box
from nerfnav.planner.kernels.maps import mark_columns

THRESHOLD = -2.0
SHAPE = (14, 11, 18)
"""Nodes: the last blocks are not whole."""


def solids_and_specks(seed: int) -> VoxelField:
    """Solid boxes of many sizes, some of whole blocks, specks and fog around the threshold, and nothing."""
    draws = np.random.default_rng(seed)
    raw = np.full(SHAPE, EMPTY_RAW, np.float32)
    for _ in range(6):
        low = draws.integers(0, SHAPE)
        high = low + draws.integers(1, 9, 3)
        raw[low[0] : high[0], low[1] : high[1], low[2] : high[2]] = draws.uniform(-1.9, 3.0)
    specks = draws.random(SHAPE) < 0.03
    raw[specks] = draws.uniform(-6.0, 2.0, specks.sum())
    values = torch.full((*SHAPE, 4), 0.5)
    values[..., 0] = torch.from_numpy(raw)
    return VoxelField(Box.of((0.0, 0.0, 0.0), (1.3, 1.0, 1.7)), values, torch.ones(3))


def by_single_cells(raw: np.ndarray, shape: tuple[int, int, int], half_height: float) -> np.ndarray:
    """Columns marked cell after cell: around the box of each one's dense part, which ends on its edges."""
    columns, reach = np.zeros(shape, np.uint8), (0.5, 0.5, half_height)
    ratios = [(shape[axis] - 1) / (raw.shape[axis] - 1) for axis in range(3)]
    for cell in np.ndindex(*(count - 1 for count in raw.shape)):
        corners = raw[tuple(slice(first, first + 2) for first in cell)].astype(float)
        if not (corners > THRESHOLD).any():
            continue
        reached = []
        for axis in range(3):
            ends = []
            for first, second in np.moveaxis(corners, axis, -1).reshape(4, 2):
                inner = (THRESHOLD - first) / (second - first) if first != second else 0.0
                ends += [0.0 if first > THRESHOLD else inner] if max(first, second) > THRESHOLD else []
                ends += [1.0 if second > THRESHOLD else inner] if max(first, second) > THRESHOLD else []
            low = math.ceil((cell[axis] + min(ends)) * ratios[axis] - reach[axis] - 1e-6)
            high = math.floor((cell[axis] + max(ends)) * ratios[axis] + reach[axis] + 1e-6)
            reached.append(slice(max(low, 0), min(high, shape[axis] - 1) + 1))
        columns[tuple(reached)] = 1
    return columns


@pytest.mark.parametrize("shape", [(27, 21, 9), (9, 8, 18), (40, 31, 35)])
@pytest.mark.parametrize("seed", range(4))
def test_blocks_and_runs_mark_the_columns_that_their_cells_would_mark(seed: int, shape: tuple[int, int, int]) -> None:
    field = solids_and_specks(seed)
    wanted = by_single_cells(field.values[..., 0].numpy(), shape, 1.3)
    for kept in (field, convert_to_bricks(field)):
        values, occupied, lower, _ = kept.kernel_grid
        columns = np.zeros(shape, np.uint8)
        mark_columns(values, occupied, lower, THRESHOLD, 1.3, columns)
        np.testing.assert_array_equal(columns, wanted)
    assert 0.05 < wanted.mean() < 0.95

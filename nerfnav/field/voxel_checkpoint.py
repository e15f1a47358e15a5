"""Codec of voxel fields: a byte for each number of each node, which zips well, for empty nodes are all alike."""

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import torch

from nerfnav.field.bricks import BrickField, Slab, bricks_of_slabs
from nerfnav.field.codec import Encoded, FieldCodec
from nerfnav.field.evidence import State, states_of_unseen
from nerfnav.field.info import FieldInfo
from nerfnav.field.stored_values import quantised, values_of
from nerfnav.field.surroundings import Surroundings
from nerfnav.field.voxel import VoxelField
from nerfnav.geometry import Box, with_neighbours

MOST_DENSE_NODES = 60_000_000
"""Nodes that are held whole: a gigabyte of them."""
_VERSION = 3  # 2: surroundings and unseen nodes, both optional; 3: evidence in place of unseen nodes


def encode(field: VoxelField) -> Encoded:
    """See FieldCodec."""
    raw, color = quantised(field.values)
    color[~with_neighbours(torch.from_numpy(raw > 0)).numpy()] = 0  # colours that nothing can show
    arrays = {
        "raw": raw,
        "color": color,
        "box": torch.stack([field.box.lower, field.box.upper]).cpu().numpy(),
        "background": field.background.cpu().numpy(),
    }
    if field.outside is not None:
        arrays["outside_raw"], arrays["outside_color"] = quantised(field.outside.values)
    if field.evidence is not None:
        arrays["evidence"] = field.evidence.cpu().numpy()
    return {"info": asdict(field.info)}, arrays


def decode(header: Mapping[str, Any], file: Mapping[str, np.ndarray]) -> VoxelField | BrickField:
    """See FieldCodec. A grid of very many nodes comes as bricks: most of it is empty, and all of it would fill the
    memory."""
    raw, color = file["raw"], file["color"]
    background, info = torch.from_numpy(file["background"]), FieldInfo.of(header["info"])
    box, outside = box_of(file["box"]), outside_of(file)
    if raw.size > MOST_DENSE_NODES and "unknown" not in file:
        made = bricks_of_slabs(box, raw.shape, _slabs(raw, color, file), background)
        return replace(made, info=info, outside=outside)
    values = values_of(raw, color)
    return VoxelField(box, values, background, info, outside, _evidence_of(file, values.shape[:3], values[..., 0]))


def box_of(corners: np.ndarray) -> Box:
    """The box between two corners (2, 3) [m]. Raises ValueError where there is none."""
    if corners.shape != (2, 3):
        raise ValueError("arrays of wrong shape")
    if not (np.isfinite(corners).all() and (corners[1] > corners[0]).all()):
        raise ValueError("an empty box")
    return Box(torch.from_numpy(corners[0]), torch.from_numpy(corners[1]))


def outside_of(file: Mapping[str, np.ndarray]) -> Surroundings | None:
    """The surroundings, where a file has some."""
    if "outside_raw" not in file:
        return None
    return Surroundings(values_of(file["outside_raw"], file["outside_color"]))


def _slabs(
    raw: np.ndarray, color: np.ndarray, file: Mapping[str, np.ndarray]
) -> Callable[[int, int], Slab]:
    """Parts of a grid along x, as floats only while they are looked at."""
    states = _evidence_of(file, raw.shape)

    def slab(first: int, end: int) -> Slab:
        return values_of(raw[first:end], color[first:end]), None if states is None else states[first:end]

    return slab


def _evidence_of(
    file: Mapping[str, np.ndarray], shape: tuple[int, ...], raw: torch.Tensor | None = None
) -> torch.Tensor | None:
    """The state of each node; of older files, which only tell what no camera saw, as far as they and `raw` go."""
    if "evidence" in file:
        states = file["evidence"]
        if states.dtype != np.uint8 or states.shape != tuple(shape) or states.max() > max(State):
            raise ValueError("evidence of another kind or shape")
        return torch.from_numpy(states)
    if "unknown" not in file or raw is None:
        return None
    flags = np.unpackbits(file["unknown"], count=math.prod(shape)).astype(bool)
    return states_of_unseen(torch.from_numpy(flags.reshape(shape)), raw)


VOXELS = FieldCodec("nerfnav-voxel-field", _VERSION, VoxelField, encode, decode)

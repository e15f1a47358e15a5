"""Codecs of grid fields: a byte for each number of each node, which zips well, and the place of each brick.

A dense grid of very many nodes is read as bricks.
"""

from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import torch

from nerfnav.field.core.codec import Encoded, FieldCodec
from nerfnav.field.core.info import FieldInfo
from nerfnav.field.models.bricks import CELLS, NODES, BrickField, Slab, build_bricks
from nerfnav.field.models.grid_field import GridField
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.storage.array_encoding import (
    check_numbers,
    decode_box,
    decode_occupancy,
    decode_surroundings,
    dequantise,
    quantise,
)
from nerfnav.geometry import dilate_nodes

MOST_DENSE_NODES = 60_000_000
"""Nodes that are held whole: a gigabyte of them."""


def encode_voxels(field: VoxelField) -> Encoded:
    """Encode a voxel field (see FieldCodec)."""
    arrays = _encode(field)
    shown = dilate_nodes(torch.from_numpy(arrays["raw"] > 0)).numpy()
    arrays["color"][~shown] = 0  # colours that nothing can show
    return Encoded({"info": asdict(field.info)}, arrays)


def decode_voxels(header: Mapping[str, Any], file: Mapping[str, np.ndarray]) -> VoxelField | BrickField:
    """Decode a voxel field (see FieldCodec).

    A grid of very many nodes comes as bricks: most of it is empty, and all of it would fill the memory.
    """
    raw, color = file["raw"], file["color"]
    if raw.ndim != 3 or min(raw.shape) < 2:
        raise ValueError(f"its grid of {raw.shape} has fewer than 2 nodes along an axis")
    background, info = check_numbers("background", file["background"], (3,)), FieldInfo.of(header["info"])
    box, outside = decode_box(file["box"]), decode_surroundings(file)
    if raw.size > MOST_DENSE_NODES and "unknown" not in file:
        states = decode_occupancy(file, raw.shape)
        made = build_bricks(
            box,
            raw.shape,
            lambda first, end: Slab(  # as floats only while they are used
                dequantise(raw[first:end], color[first:end]), None if states is None else states[first:end]
            ),
            background,
        )
        return replace(made, info=info, outside=outside)
    values = dequantise(raw, color)
    return VoxelField(box, values, background, info, outside, decode_occupancy(file, values.shape[:3], values[..., 0]))


def encode_bricks(field: BrickField) -> Encoded:
    """Encode a field of bricks (see FieldCodec)."""
    arrays = _encode(field, slots=field.slots.cpu().numpy(), nodes=np.array(field.nodes))
    arrays["color"][(arrays["raw"] == 0).all((1, 2, 3))] = 0  # colours that nothing can show
    return Encoded({"info": asdict(field.info)}, arrays)


def decode_bricks(header: Mapping[str, Any], file: Mapping[str, np.ndarray]) -> BrickField:
    """Decode a field of bricks (see FieldCodec)."""
    raw, slots, counts = file["raw"], file["slots"], [int(count) for count in file["nodes"]]
    nx, ny, nz = counts
    whole = slots.dtype == np.int32 and raw.shape[1:] == (NODES, NODES, NODES) and min(counts) >= 2
    if not whole or slots.shape != tuple(-(-count // CELLS) for count in counts):
        raise ValueError("bricks of another kind or number")
    if slots.min() < 0 or slots.max() >= len(raw):  # so there is at least one brick
        raise ValueError("a block without its brick")
    return BrickField(
        decode_box(file["box"]),
        dequantise(raw, file["color"], axes=4),
        check_numbers("background", file["background"], (3,)),
        FieldInfo.of(header["info"]),
        decode_surroundings(file),
        decode_occupancy(file, raw.shape),
        nodes=(nx, ny, nz),
        slots=torch.from_numpy(slots),
    )


def _encode(field: GridField, **layout: np.ndarray) -> dict[str, np.ndarray]:
    """Arrays that all grid fields have, and those of the layout of their nodes."""
    raw, color = quantise(field.values)
    arrays = {
        "raw": raw,
        "color": color,
        **layout,
        "box": torch.stack([field.box.lower, field.box.upper]).cpu().numpy(),
        "background": field.background.cpu().numpy(),
    }
    if field.outside is not None:
        arrays["outside_raw"], arrays["outside_color"] = quantise(field.outside.values)
    if field.evidence is not None:
        arrays["evidence"] = field.evidence.cpu().numpy()
    return arrays


# 2: surroundings and unseen nodes, both optional; 3: evidence in place of unseen nodes
VOXELS = FieldCodec("nerfnav-voxel-field", 3, VoxelField, encode_voxels, decode_voxels)
BRICKS = FieldCodec("nerfnav-brick-field", 1, BrickField, encode_bricks, decode_bricks)

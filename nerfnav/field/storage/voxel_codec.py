"""Codec of voxel fields: a byte for each number of each node, which zips well, for empty nodes are all alike."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import torch

from nerfnav.field.core.codec import Encoded, FieldCodec
from nerfnav.field.core.info import FieldInfo
from nerfnav.field.models.bricks import BrickField, Slab, build_bricks
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.storage.array_encoding import box_of, evidence_of, outside_of, quantised, values_of
from nerfnav.geometry import dilate_nodes

MOST_DENSE_NODES = 60_000_000
"""Nodes that are held whole: a gigabyte of them."""
_VERSION = 3  # 2: surroundings and unseen nodes, both optional; 3: evidence in place of unseen nodes


def encode(field: VoxelField) -> Encoded:
    """See FieldCodec."""
    raw, color = quantised(field.values)
    color[~dilate_nodes(torch.from_numpy(raw > 0)).numpy()] = 0  # colours that nothing can show
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
        made = build_bricks(box, raw.shape, _slabs(raw, color, file), background)
        return replace(made, info=info, outside=outside)
    values = values_of(raw, color)
    return VoxelField(box, values, background, info, outside, evidence_of(file, values.shape[:3], values[..., 0]))


def _slabs(
    raw: np.ndarray, color: np.ndarray, file: Mapping[str, np.ndarray]
) -> Callable[[int, int], Slab]:
    """Parts of a grid along x, as floats only while they are looked at."""
    states = evidence_of(file, raw.shape)

    def slab(first: int, end: int) -> Slab:
        return values_of(raw[first:end], color[first:end]), None if states is None else states[first:end]

    return slab


VOXELS = FieldCodec("nerfnav-voxel-field", _VERSION, VoxelField, encode, decode)

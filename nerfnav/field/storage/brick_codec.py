"""Codec of fields of bricks: the bricks' numbers as bytes, and where each brick is."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np
import torch

from nerfnav.field.core.codec import Encoded, FieldCodec
from nerfnav.field.core.info import FieldInfo
from nerfnav.field.core.occupancy import State
from nerfnav.field.models.bricks import CELLS, NODES, BrickField
from nerfnav.field.storage.array_encoding import box_of, outside_of, quantised, values_of


def encode(field: BrickField) -> Encoded:
    """See FieldCodec."""
    raw, color = quantised(field.values)
    color[(raw == 0).all((1, 2, 3))] = 0  # colours that nothing can show
    arrays = {
        "raw": raw,
        "color": color,
        "slots": field.slots.cpu().numpy(),
        "nodes": np.array(field.nodes),
        "box": torch.stack([field.box.lower, field.box.upper]).cpu().numpy(),
        "background": field.background.cpu().numpy(),
    }
    if field.outside is not None:
        arrays["outside_raw"], arrays["outside_color"] = quantised(field.outside.values)
    if field.evidence is not None:
        arrays["evidence"] = field.evidence.cpu().numpy()
    return {"info": asdict(field.info)}, arrays


def decode(header: Mapping[str, Any], file: Mapping[str, np.ndarray]) -> BrickField:
    """See FieldCodec."""
    raw, slots, counts = file["raw"], file["slots"], [int(count) for count in file["nodes"]]
    nx, ny, nz = counts
    whole = slots.dtype == np.int32 and raw.shape[1:] == (NODES, NODES, NODES) and min(counts) >= 2
    if not whole or slots.shape != tuple(-(-count // CELLS) for count in counts):
        raise ValueError("bricks of another kind or number")
    if slots.min() < 0 or slots.max() >= len(raw):
        raise ValueError("a block without its brick")
    states = file.get("evidence")
    if states is not None and (states.dtype != np.uint8 or states.shape != raw.shape or states.max() > max(State)):
        raise ValueError("evidence of another kind or shape")
    return BrickField(
        box_of(file["box"]),
        (nx, ny, nz),
        values_of(raw, file["color"], axes=4),
        torch.from_numpy(slots),
        torch.from_numpy(file["background"]),
        FieldInfo.of(header["info"]),
        outside_of(file),
        None if states is None else torch.from_numpy(states),
    )


BRICKS = FieldCodec("nerfnav-brick-field", 1, BrickField, encode, decode)

"""Voxel fields in files.

Raw densities are stored in steps of 1/8 and colours in steps of 1/255, which zip well: empty nodes are all alike.
"""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np
import torch

from nerfnav.field.codec import Encoded, FieldCodec
from nerfnav.field.evidence import EMPTY_RAW, State, states_of_unseen
from nerfnav.field.info import FieldInfo
from nerfnav.field.surroundings import Surroundings
from nerfnav.field.voxel import VoxelField
from nerfnav.geometry import Box, with_neighbours

_VERSION = 3  # 2: surroundings and unseen nodes, both optional; 3: evidence in place of unseen nodes
_RAW_STEP = 1 / 8  # [raw]: less than 13 % of a density, far below what images can tell


def _encode(field: VoxelField) -> Encoded:
    """See FieldCodec."""
    raw, color = _quantised(field.values)
    color[~with_neighbours(torch.from_numpy(raw > 0)).numpy()] = 0  # colours that nothing can show
    arrays = {
        "raw": raw,
        "color": color,
        "box": torch.stack([field.box.lower, field.box.upper]).cpu().numpy(),
        "background": field.background.cpu().numpy(),
    }
    if field.outside is not None:
        arrays["outside_raw"], arrays["outside_color"] = _quantised(field.outside.values)
    if field.evidence is not None:
        arrays["evidence"] = field.evidence.cpu().numpy()
    return {"info": asdict(field.info)}, arrays


def _decode(header: Mapping[str, Any], file: Mapping[str, np.ndarray]) -> VoxelField:
    """See FieldCodec."""
    values, box = _values_of(file["raw"], file["color"]), file["box"]
    if box.shape != (2, 3):
        raise ValueError("arrays of wrong shape")
    if not (np.isfinite(box).all() and (box[1] > box[0]).all()):
        raise ValueError("an empty box")
    outside = _values_of(file["outside_raw"], file["outside_color"]) if "outside_raw" in file else None
    return VoxelField(
        Box(torch.from_numpy(box[0]), torch.from_numpy(box[1])),
        values,
        torch.from_numpy(file["background"]),
        FieldInfo.of(header["info"]),
        None if outside is None else Surroundings(outside),
        _evidence_of(file, values),
    )


def _quantised(values: torch.Tensor) -> tuple[np.ndarray, np.ndarray]:
    """Raw densities (nx, ny, nz) and colours (nx, ny, nz, 3) as bytes."""
    raw = values[..., 0].detach().cpu().numpy()
    color = values[..., 1:].detach().cpu().numpy().clip(0, 1)
    return (
        np.clip(np.rint((raw - EMPTY_RAW) / _RAW_STEP), 0, 255).astype(np.uint8),
        np.rint(color * 255).astype(np.uint8),
    )


def _values_of(raw: np.ndarray, color: np.ndarray) -> torch.Tensor:
    """Node values (nx, ny, nz, 4) from their bytes."""
    if raw.dtype != np.uint8 or raw.ndim != 3 or color.shape != (*raw.shape, 3):
        raise ValueError("arrays of wrong shape")
    values = np.empty((*raw.shape, 4), np.float32)
    values[..., 0] = raw * np.float32(_RAW_STEP) + np.float32(EMPTY_RAW)
    values[..., 1:] = color * np.float32(1 / 255)
    return torch.from_numpy(values)


def _evidence_of(file: Mapping[str, np.ndarray], values: torch.Tensor) -> torch.Tensor | None:
    """The state of each node; of older files, which only tell what no camera saw, as far as they go."""
    shape = values.shape[:3]
    if "evidence" in file:
        states = file["evidence"]
        if states.dtype != np.uint8 or states.shape != tuple(shape) or states.max() > max(State):
            raise ValueError("evidence of another kind or shape")
        return torch.from_numpy(states)
    if "unknown" not in file:
        return None
    flags = np.unpackbits(file["unknown"], count=shape.numel()).astype(bool)
    return states_of_unseen(torch.from_numpy(flags.reshape(shape)), values[..., 0])


VOXEL = FieldCodec("nerfnav-voxel-field", _VERSION, VoxelField, _encode, _decode)

"""Node values as bytes in files: raw densities in steps of 1/8, colours in steps of 1/255."""

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from nerfnav.field.evidence import EMPTY_RAW

_RAW_STEP = 1 / 8  # [raw]: less than 13 % of a density, far below what images can tell


def quantised(values: Float[Tensor, "*nodes 4"]) -> tuple[UInt8[np.ndarray, "*nodes"], UInt8[np.ndarray, "*nodes 3"]]:
    """Raw densities and colours as bytes."""
    raw = values[..., 0].detach().cpu().numpy()
    color = values[..., 1:].detach().cpu().numpy().clip(0, 1)
    return (
        np.clip(np.rint((raw - EMPTY_RAW) / _RAW_STEP), 0, 255).astype(np.uint8),
        np.rint(color * 255).astype(np.uint8),
    )


def values_of(raw: np.ndarray, color: np.ndarray, axes: int = 3) -> Float[Tensor, "*nodes 4"]:
    """Node values on so many axes from their bytes. Raises ValueError for arrays of another kind."""
    if raw.dtype != np.uint8 or raw.ndim != axes or color.dtype != np.uint8 or color.shape != (*raw.shape, 3):
        raise ValueError("arrays of wrong shape")
    values = np.empty((*raw.shape, 4), np.float32)
    values[..., 0] = raw * np.float32(_RAW_STEP) + np.float32(EMPTY_RAW)
    values[..., 1:] = color * np.float32(1 / 255)
    return torch.from_numpy(values)

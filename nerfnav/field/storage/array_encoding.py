"""Array encoding of grid fields: quantise node values to bytes, and store the box, the surroundings and the evidence.

Raw densities are in steps of 1/8, colours in steps of 1/255.
"""

import math
from collections.abc import Mapping

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from nerfnav.field.core.occupancy import EMPTY_RAW, Occupancy, classify_unseen
from nerfnav.field.render.surroundings import Surroundings
from nerfnav.geometry import Box

_FARTHEST = 1e6
"""Distance from the origin [m] beyond which single precision has no place for details."""
_RAW_STEP = 1 / 8  # [raw]: less than 13 % of a density, far below what images can show


def quantise(values: Float[Tensor, "*nodes 4"]) -> tuple[UInt8[np.ndarray, "*nodes"], UInt8[np.ndarray, "*nodes 3"]]:
    """Raw densities and colours as bytes."""
    raw = values[..., 0].detach().cpu().numpy()
    color = values[..., 1:].detach().cpu().numpy().clip(0, 1)
    return (
        np.clip(np.rint((raw - EMPTY_RAW) / _RAW_STEP), 0, 255).astype(np.uint8),
        np.rint(color * 255).astype(np.uint8),
    )


def dequantise(raw: np.ndarray, color: np.ndarray, axes: int = 3) -> Float[Tensor, "*nodes 4"]:
    """Node values on so many axes from their bytes. Raises ValueError for arrays of another kind."""
    if raw.dtype != np.uint8 or raw.ndim != axes or color.dtype != np.uint8 or color.shape != (*raw.shape, 3):
        raise ValueError("its densities and colours have wrong types or shapes")
    values = np.empty((*raw.shape, 4), np.float32)
    values[..., 0] = raw * np.float32(_RAW_STEP) + np.float32(EMPTY_RAW)
    values[..., 1:] = color * np.float32(1 / 255)
    return torch.from_numpy(values)


def decode_box(corners: np.ndarray) -> Box:
    """The box between two corners (2, 3) [m]. Raises ValueError where there is none."""
    lower, upper = check_numbers("box", corners, (2, 3))
    if not (np.abs(corners).max() <= _FARTHEST and (corners[1] > corners[0]).all()):
        raise ValueError(f"its box is empty, or more than {_FARTHEST:g} m from the origin")
    return Box(lower, upper)


def check_numbers(name: str, array: np.ndarray, shape: tuple[int, ...]) -> Float[Tensor, "*shape"]:
    """Check an array of finite floating-point numbers of that shape. Raises ValueError, which names it."""
    if array.dtype not in (np.float32, np.float64) or array.shape != shape:
        raise ValueError(f"its array {name!r} is {array.dtype} of shape {array.shape}, not numbers of shape {shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"its array {name!r} has numbers that are not finite")
    return torch.from_numpy(array)


def decode_surroundings(file: Mapping[str, np.ndarray]) -> Surroundings | None:
    """The surroundings, where a file has some."""
    if "outside_raw" not in file:
        return None
    values = dequantise(file["outside_raw"], file["outside_color"])
    if not values.shape[0] == values.shape[1] == values.shape[2] or values.shape[0] < 4:
        raise ValueError(f"its surroundings are a grid of {tuple(values.shape[:3])}, not a cube of nodes")
    return Surroundings(values)


def decode_occupancy(
    file: Mapping[str, np.ndarray], shape: tuple[int, ...], raw: Tensor | None = None
) -> Tensor | None:
    """The occupancy of each node; of older files, which only note what no camera saw, as far as they and `raw` go."""
    if "evidence" in file:
        states = file["evidence"]
        if states.dtype != np.uint8 or states.shape != tuple(shape) or states.max(initial=0) > max(Occupancy):
            raise ValueError("evidence of another kind or shape")
        return torch.from_numpy(states)
    if "unknown" not in file or raw is None:
        return None
    flags = np.unpackbits(file["unknown"], count=math.prod(shape)).astype(bool)
    return classify_unseen(torch.from_numpy(flags.reshape(shape)), raw)

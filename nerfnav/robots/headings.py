"""Headings for a robot that can only drive where it heads: along a way, forward or in reverse."""

import math

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.robots.ground import wrapped

_TURNING_SHARE = 0.25
"""Share of the way over which headings turn from the start's to the way's, and at the end to the goal's."""
_STILL = 0.2
"""Share of the mean step below which a step's direction says nothing of the way's."""


def headings_along(
    moved: Float[Tensor, "n 2"], first: Float[Tensor, ""], last: Float[Tensor, ""]
) -> tuple[Float[Tensor, " times"], float]:
    """Headings [rad] at each time for a robot whose steps move it by `moved` [m], between those at its ends.

    Also 1 for forward or -1 for reverse, whichever takes less turning at the ends.
    """
    steps = moved.norm(dim=-1)
    way = torch.atan2(moved[:, 1], moved[:, 0])[_nearest_moving(steps <= _STILL * steps.mean())]
    gear = 1.0 if _turning(way, first, last) <= _turning(way + math.pi, first, last) else -1.0
    way = way if gear > 0 else way + math.pi
    at = torch.cat([way[:1], way[:-1] + 0.5 * wrapped(way.diff()), way[-1:]])
    yaw = unwrapped(torch.cat([first[None], at, last[None]]))
    first, at, last = yaw[:1], yaw[1:-1], yaw[-1:]
    share = torch.linspace(0, 1, len(at)).to(at)
    early = (1 - share / _TURNING_SHARE).clamp_min(0)
    late = (1 - (1 - share) / _TURNING_SHARE).clamp_min(0)
    early, late = (w * w * (3 - 2 * w) for w in (early, late))
    return at + early * (first - at) + late * (last - at), gear


def unwrapped(angles: Float[Tensor, " n"]) -> Float[Tensor, " n"]:
    """The same angles [rad], each within half a turn of the one before it."""
    return torch.cat([angles[:1], angles[:1] + wrapped(angles.diff()).cumsum(0)])


def _turning(way: Tensor, first: Tensor, last: Tensor) -> float:
    """How far a robot turns at both ends of a way [rad]."""
    return (wrapped(way[0] - first).abs() + wrapped(last - way[-1]).abs()).item()


def _nearest_moving(still: Tensor) -> Tensor:
    """For each step the nearest one that moves, itself where none does."""
    index = torch.arange(len(still))
    if bool(still.all()):
        return index
    moving = index[~still]
    return moving[(index[:, None] - moving).abs().argmin(-1)]

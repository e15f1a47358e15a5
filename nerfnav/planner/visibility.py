"""Visibility by heading: the share of a camera's picture that shows something and has edges.

A robot that flies by its camera is lost in front of the void, or of a blank wall. A tiny picture already measures how
informative the real one is. With v the sum of a pixel's squared differences from its neighbours (mean over the
channels), it shows a share v / (v + 2 c^2) of an edge. The mean of that goes with the number of patches that agree with
the real picture (the photometric estimator): rank correlation 0.71 to 0.79 in four places, where that of the share
which is not void is 0.6 to 0.8 outdoors, and 0 in rooms. The lesser of both counts, for the rims of things before the
void are edges too.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.field import FastRenderer, Field, render_rays
from nerfnav.geometry import FORWARD_MOUNT, Camera, Pose, so3
from nerfnav.robots import RigidState, thrust_and_attitude

_PROBE = Camera.from_fov(6, 4, 90)
"""Camera of the tiny pictures."""
_EDGE = 0.15
"""c: difference of colours at half an edge [1 = full scale]."""
_RAYS = 4096
"""Rays rendered at once by the reference."""
VIEW_HEADINGS = 16
"""Number of headings, over a whole turn, at which visibility is measured."""


@torch.no_grad()
def measure_visibility(
    matter: Field,
    points: Float[Tensor, "n 3"],
    yaws: Float[Tensor, " h"],
    mount: Pose = FORWARD_MOUNT,
    up: Float[Tensor, "n 3"] | None = None,
) -> Float[np.ndarray, "n h"]:
    """Measure the share of its picture, 0 to 1, in which a camera on a body at each point sees something with edges, by
    the body's heading. The body's z axis is `up`, of any length; None: it is level."""
    in_body = _PROBE.directions(_PROBE.pixels()) @ mount.rotation.T
    turns = so3.from_yaw(yaws)[None]
    if up is not None:
        turns = thrust_and_attitude(up, torch.zeros_like(up[:, 0]))[1][:, None] @ turns
    directions = torch.einsum("nhij,rj->nhri", turns, in_body)
    count, rays = len(points), directions.shape[1] * directions.shape[2]
    origins = points[:, None].expand(count, rays, 3).reshape(-1, 3)
    along = directions.reshape(-1, rays, 3).expand(count, rays, 3).reshape(-1, 3)
    if isinstance(matter, FastRenderer):
        parts = [matter.render_rays(origins, along)]
    else:
        parts = [
            render_rays(matter, some.to(matter.box.lower), where.to(matter.box.lower))
            for some, where in zip(origins.split(_RAYS), along.split(_RAYS), strict=True)
        ]
    color, opacity = (torch.cat([getattr(part, name).cpu() for part in parts]) for name in ("color", "opacity"))
    edges = _edges(color.reshape(count, len(yaws), _PROBE.height, _PROBE.width, 3)).mean((-2, -1))
    return edges.minimum(opacity.reshape(count, len(yaws), -1).mean(-1)).numpy()


def _edges(color: Float[Tensor, "n h v u 3"]) -> Float[Tensor, "n h v u"]:
    """Compare each pixel with its neighbours, 0 to 1."""
    across, down = (color.diff(dim=axis).square().mean(-1) for axis in (-2, -3))
    pad = torch.nn.functional.pad
    differs = pad(across, (1, 0)) + pad(across, (0, 1)) + pad(down, (0, 0, 1, 0)) + pad(down, (0, 0, 0, 1))
    return differs / (differs + 2 * _EDGE**2)


@dataclass(frozen=True)
class VisibilityProfile:
    """Visibility by heading from places along a path."""

    seen: Float[np.ndarray, "n h"]
    """Shares of `enough`, 0 to 1; headings evenly from 0 to a whole turn."""

    @classmethod
    def along(
        cls,
        matter: Field,
        path: Float[Tensor, "n 3"],
        up: Float[Tensor, "n 3"],
        enough: float,
        mount: Pose = FORWARD_MOUNT,
    ) -> "VisibilityProfile":
        """Measure it from places of a path [m] with the body's z axis there; `enough` is the share with edges from
        which on a picture is as good as any."""
        yaws = torch.arange(VIEW_HEADINGS) * (math.tau / VIEW_HEADINGS)
        return cls(measure_visibility(matter, path, yaws, mount, up=up).clip(max=enough) / enough)

    def at(self, places: Float[np.ndarray, " *n"], yaws: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
        """Interpolate at shares of the path, 0 to 1, and headings [rad]; linear between."""
        row = places * (len(self.seen) - 1)
        first = np.minimum(row.astype(int), max(0, len(self.seen) - 2))
        second = np.minimum(first + 1, len(self.seen) - 1)
        return (1 - (row - first)) * self._turned(first, yaws) + (row - first) * self._turned(second, yaws)

    def _turned(self, row: np.ndarray, yaws: np.ndarray) -> np.ndarray:
        at = yaws % math.tau * (VIEW_HEADINGS / math.tau)
        low, rest = np.floor(at).astype(int), at % 1
        return (1 - rest) * self.seen[row, low % VIEW_HEADINGS] + rest * self.seen[row, (low + 1) % VIEW_HEADINGS]


class BestTurn(NamedTuple):
    """Visibility of a robot's view, and the turn to the best one."""

    share: float
    """Share of `enough` that is visible now, 0 to 1."""
    turn: float
    """Turn to the nearest heading with the best view [rad, to the left]."""


def find_best_turn(matter: Field, state: RigidState, enough: float, mount: Pose = FORWARD_MOUNT) -> BestTurn:
    """Compare the view of a robot's camera with those at other headings."""
    turns = torch.arange(-VIEW_HEADINGS // 2, VIEW_HEADINGS // 2) * (math.tau / VIEW_HEADINGS)
    seen = measure_visibility(matter, state.position[None], so3.yaw_of(state.rotation) + turns, mount)[0]
    seen = seen.clip(max=enough) / enough
    near_first = np.argsort(turns.abs().numpy(), kind="stable")
    best = max(near_first, key=lambda heading: seen[heading].round(6))
    return BestTurn(float(seen[VIEW_HEADINGS // 2]), float(turns[best]))

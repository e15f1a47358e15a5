"""Visibility by heading: how much of what a camera would see is something and has edges.

A robot that flies by its camera is lost in front of the void, or of a blank wall. How much a picture tells shows in a
tiny one already. With v the sum of a pixel's squared differences from those beside it (mean over the channels), it
shows a share v / (v + 2 c^2) of an edge. The mean of that goes with the number of patches that share what the real
picture tells (the photometric estimator): rank correlation 0.71 to 0.79 in four places, where that of the share which
is not void is 0.6 to 0.8 outdoors, and 0 in rooms. Of both the lesser counts, for the rims of things before the void
are edges too.
"""

import math
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.field import FastRenderer, Field, render_rays
from nerfnav.geometry import FORWARD_MOUNT, Camera, Pose, so3
from nerfnav.robots import RigidState, thrust_and_attitude

_EYE = Camera.from_fov(6, 4, 90)
"""What looks around."""
_EDGE = 0.15
"""c: how much colours differ at what is half an edge [1 = full scale]."""
_RAYS = 4096
"""Rays rendered at once by the reference."""
VIEW_HEADINGS = 16
"""Into how many directions a robot looks that looks for one."""


def measure_visibility(
    matter: Field,
    points: Float[Tensor, "n 3"],
    yaws: Float[Tensor, " h"],
    mount: Pose = FORWARD_MOUNT,
    up: Float[Tensor, "n 3"] | None = None,
) -> Float[np.ndarray, "n h"]:
    """How much of what a camera on a body at each point sees is something and has edges, by the body's heading, 0 to 1:
    whichever of both is less. The body's z axis is `up`, of any length; None: it is level."""
    in_body = _EYE.directions(_EYE.pixels()) @ mount.rotation.T
    turns = so3.from_yaw(yaws)[None]
    if up is not None:
        turns = thrust_and_attitude(up, torch.zeros_like(up[:, 0]))[1][:, None] @ turns
    directions = torch.einsum("nhij,rj->nhri", turns, in_body)
    count, rays = len(points), directions.shape[1] * directions.shape[2]
    origins = points[:, None].expand(count, rays, 3).reshape(-1, 3)
    along = directions.reshape(-1, rays, 3).expand(count, rays, 3).reshape(-1, 3)
    with torch.no_grad():
        if isinstance(matter, FastRenderer):
            parts = [matter.render_rays(origins, along)]
        else:
            parts = [
                render_rays(matter, some.to(matter.box.lower), where.to(matter.box.lower))
                for some, where in zip(origins.split(_RAYS), along.split(_RAYS), strict=True)
            ]
    color, opacity = (torch.cat([getattr(part, name).cpu() for part in parts]) for name in ("color", "opacity"))
    edges = _edges(color.reshape(count, len(yaws), _EYE.height, _EYE.width, 3)).mean((-2, -1))
    return edges.minimum(opacity.reshape(count, len(yaws), -1).mean(-1)).numpy()


def _edges(color: Float[Tensor, "n h v u 3"]) -> Float[Tensor, "n h v u"]:
    """How far each pixel differs from those beside it, 0 to 1."""
    across, down = (color.diff(dim=axis).square().mean(-1) for axis in (-2, -3))
    pad = torch.nn.functional.pad
    differs = pad(across, (1, 0)) + pad(across, (0, 1)) + pad(down, (0, 0, 1, 0)) + pad(down, (0, 0, 0, 1))
    return differs / (differs + 2 * _EDGE**2)


@dataclass(frozen=True)
class VisibilityProfile:
    """What is seen by heading from places along a way."""

    seen: Float[np.ndarray, "n h"]
    """Shares of what is enough, 0 to 1; headings evenly from 0 to a whole turn."""

    @classmethod
    def along(
        cls, matter: Field, way: tuple[Tensor, Tensor], enough: float, mount: Pose = FORWARD_MOUNT
    ) -> "VisibilityProfile":
        """From places of a way (n, 3) [m] with the body's z axis there (n, 3); `enough` is the share with edges from
        which on a picture is as good as any."""
        seen = measure_visibility(
            matter, way[0], torch.arange(VIEW_HEADINGS) * (math.tau / VIEW_HEADINGS), mount, up=way[1]
        )
        return cls(seen.clip(max=enough) / enough)

    def at(self, places: Float[np.ndarray, " *n"], yaws: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
        """At shares of the way, 0 to 1, and headings [rad]; linear between."""
        row = places * (len(self.seen) - 1)
        first = np.minimum(row.astype(int), max(0, len(self.seen) - 2))
        second = np.minimum(first + 1, len(self.seen) - 1)
        return (1 - (row - first)) * self._turned(first, yaws) + (row - first) * self._turned(second, yaws)

    def _turned(self, row: np.ndarray, yaws: np.ndarray) -> np.ndarray:
        at = yaws % math.tau * (VIEW_HEADINGS / math.tau)
        low, rest = np.floor(at).astype(int), at % 1
        return (1 - rest) * self.seen[row, low % VIEW_HEADINGS] + rest * self.seen[row, (low + 1) % VIEW_HEADINGS]


def find_best_turn(
    matter: Field, state: RigidState, enough: float, mount: Pose = FORWARD_MOUNT
) -> tuple[float, float]:
    """How much of `enough` a camera sees that has edges, 0 to 1, and by how much its robot has to turn to see as much
    of it as it can: to the nearest of the headings from which that is [rad, to the left]."""
    turns = torch.arange(-VIEW_HEADINGS // 2, VIEW_HEADINGS // 2) * (math.tau / VIEW_HEADINGS)
    seen = measure_visibility(matter, state.position[None], so3.yaw_of(state.rotation) + turns, mount)[0]
    seen = seen.clip(max=enough) / enough
    near_first = np.argsort(turns.abs().numpy(), kind="stable")
    best = max(near_first, key=lambda heading: seen[heading].round(6))
    return float(seen[VIEW_HEADINGS // 2]), float(turns[best])

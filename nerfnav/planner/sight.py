"""What a camera sees by its heading: a robot that flies by its camera is lost in front of the void."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

import numpy as np
import torch
from jaxtyping import Float

from nerfnav.field import FastRenderer, Field, render_rays
from nerfnav.geometry import FORWARD_MOUNT, Camera, Pose, so3
from nerfnav.planner.astar import resample
from nerfnav.robots import RigidState

_EYE = Camera.from_fov(6, 4, 90)
"""What looks around."""
_RAYS = 4096
"""Rays rendered at once by the reference."""
_HEADINGS, _PLACES = 16, 10
"""Into how many directions a robot looks that looks for one, and from how many places on its way."""
_DEAR = 0.1
"""How much more variance on the way [that of one picture's time] half a turn at the goal is worth."""
Angle = TypeVar("Angle", float, np.ndarray)


def seen_from(
    matter: Field, points: Float[torch.Tensor, "n 3"], yaws: Float[torch.Tensor, " h"], mount: Pose = FORWARD_MOUNT
) -> Float[np.ndarray, "n h"]:
    """How much of what a camera on a level body at each point sees is something, by the body's heading, 0 to 1."""
    in_body = _EYE.directions(_EYE.pixels()) @ mount.rotation.T
    directions = torch.einsum("hij,rj->hri", so3.from_yaw(yaws), in_body)
    count, rays = len(points), directions.shape[0] * directions.shape[1]
    origins = points[:, None].expand(count, rays, 3).reshape(-1, 3)
    along = directions.reshape(1, rays, 3).expand(count, rays, 3).reshape(-1, 3)
    with torch.no_grad():
        if isinstance(matter, FastRenderer):
            opacity = matter.render_rays(origins, along).opacity
        else:
            opacity = torch.cat([
                render_rays(matter, some.to(matter.box.lower), where.to(matter.box.lower)).opacity.cpu()
                for some, where in zip(origins.split(_RAYS), along.split(_RAYS), strict=True)
            ])  # fmt: skip
    return opacity.reshape(count, len(yaws), -1).mean(-1).numpy()


def turned_to_see(
    matter: Field, way: Float[torch.Tensor, "n 3"], ends: tuple[RigidState, RigidState], enough: float,
    mount: Pose = FORWARD_MOUNT, may_be: Callable[[RigidState], bool] | None = None,
) -> RigidState:  # fmt: skip
    """The goal with the heading by which a robot knows best where it is on the way to it: it turns evenly as it goes.

    `way` leads from start to goal [m]. Between pictures the variance grows by 1, and a picture of which a share shows
    something takes that share of it away, all where it is `enough`: to see nothing for long is worse than to see
    nothing now and then. Half a turn from the heading that was asked for is made where the mean falls by 0.1. Of the
    headings with which the robot `may_be` there: a corner needs more room than a side. Where it may with none, the goal
    stays as it is.
    """
    start, goal = (so3.yaw_of(end.rotation).item() for end in ends)
    places = resample(way, torch.linspace(0, 1, _PLACES))
    seen = seen_from(matter, places, torch.arange(_HEADINGS) * (math.tau / _HEADINGS), mount).clip(max=enough) / enough
    share = np.linspace(0, 1, _PLACES)[:, None]
    turns = _wrapped(goal - start) + math.tau / _HEADINGS * np.arange(-_HEADINGS, _HEADINGS + 1)
    turns = turns[np.abs(turns) <= math.pi + 1e-6]
    at = (start + share * turns) % math.tau * (_HEADINGS / math.tau)
    low, rest, row = np.floor(at).astype(int), at % 1, np.arange(_PLACES)[:, None]
    shown = (1 - rest) * seen[row, low % _HEADINGS] + rest * seen[row, (low + 1) % _HEADINGS]
    off = np.abs(_wrapped(start + turns - goal))
    best_first = np.argsort((_mean_variance(shown) + _DEAR * off / math.pi).round(6), kind="stable")
    for turn in turns[best_first].tolist():
        turned = so3.from_yaw(torch.tensor(start + turn - goal)).to(way)
        end = replace(ends[1], rotation=turned @ ends[1].rotation)
        if may_be is None or may_be(end):
            return end
    return ends[1]


def _mean_variance(shown: Float[np.ndarray, "n t"]) -> Float[np.ndarray, " t"]:
    """Over the pictures of a way, for each of some turns, from how much of each shows something, 0 to 1."""
    variance, total = np.zeros(shown.shape[1]), np.zeros(shown.shape[1])
    for share in shown:
        variance = (variance + 1) * (1 - share)
        total += variance
    return total / len(shown)


def _wrapped(angle: Angle) -> Angle:
    return (angle + math.pi) % math.tau - math.pi

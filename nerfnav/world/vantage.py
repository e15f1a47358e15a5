"""Vantage points: separate rooms from open ground, and place cameras, by the share of a mesh around a point.

The orientation of faces is not used: in many files it is arbitrary.
"""

import math

import numpy as np
import torch
import trimesh
from jaxtyping import Bool, Float
from torch import Tensor

from nerfnav.geometry import Box, fibonacci_directions
from nerfnav.world.raycast import RayCaster
from nerfnav.world.scene import Vantage

_AROUND = 32
"""Rays around the horizon, at each elevation."""
_ELEVATIONS = (-0.1, 0.0, 0.1)
"""Sines of these: level rays meet walls. Roofs are often left out, to look in, and floors are everywhere."""
_ENCLOSED = 0.9
"""Share of level rays that end at the mesh from points in a room."""
_MOSTLY = 0.4
"""Share of such points among those in the box that makes the place a room."""
_IN_ROOM = 0.75
"""Share of level rays that must end at the mesh from a camera in a room: windows are open."""
_UPWARDS = 48
"""Rays over the upper half of directions."""
_SKY = 0.1
"""Share of these that must meet nothing from a camera on open ground."""
_POINTS = 400
_FLAT = 0.02
"""A place whose shortest edge is below this share of its longest is no room."""


def filter_vantage(mesh: RayCaster, points: Float[Tensor, "n 3"], vantage: Vantage) -> Bool[Tensor, " n"]:
    """Mark the points at which a camera of that vantage may stand."""
    if vantage is Vantage.ANYWHERE:
        return torch.ones(len(points), dtype=torch.bool)
    if vantage is Vantage.INSIDE:
        return _shares(mesh, points, _level_ways()) >= _IN_ROOM
    upwards = fibonacci_directions(1 - (torch.arange(_UPWARDS) + 0.5) / _UPWARDS).numpy()
    return _shares(mesh, points, upwards) <= 1 - _SKY


def guess_vantage(mesh: trimesh.Trimesh, box: Box) -> Vantage:
    """INSIDE where walls stand around a good part of the box, OUTSIDE elsewhere.

    Points inside solids count too: a place of which they are the larger part has no room for cameras anyway.
    """
    if box.size.min() <= _FLAT * box.size.max():
        return Vantage.OUTSIDE
    drawn = torch.rand(_POINTS, 3, generator=torch.Generator().manual_seed(0))
    around = _shares(RayCaster(mesh), box.lower + drawn * box.size, _level_ways())
    return Vantage.INSIDE if (around >= _ENCLOSED).float().mean() >= _MOSTLY else Vantage.OUTSIDE


def _shares(mesh: RayCaster, points: Float[Tensor, "n 3"], ways: Float[np.ndarray, "k 3"]) -> Float[Tensor, " n"]:
    """The share of directions in which each point sees the mesh."""
    origins = np.repeat(points.numpy().astype(np.float32), len(ways), axis=0)
    hit = torch.from_numpy(mesh.occluded(origins, np.tile(ways, (len(points), 1))))
    return hit.reshape(len(points), len(ways)).float().mean(1)


def _level_ways() -> Float[np.ndarray, "k 3"]:
    turn = np.arange(_AROUND) * 2 * math.pi / _AROUND
    flat = np.stack([np.cos(turn), np.sin(turn), np.zeros(_AROUND)], -1)
    return np.concatenate([math.sqrt(1 - z * z) * flat + [0, 0, z] for z in _ELEVATIONS]).astype(np.float32)

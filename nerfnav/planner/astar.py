"""The way around: A* through the occupancy map, and the path as waypoints in time."""

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.geometry import so3
from nerfnav.planner.kernels.search import cheapest_path
from nerfnav.planner.occupancy import OccupancyMap
from nerfnav.robots.state import RigidState

_SNAP_REACH = 0.3
"""How far from an end [m] the search may begin: next to a wall, the end's own voxel can be occupied."""
_SMOOTHING = 0.06
"""Length over which the corners of a voxel path are rounded [m]."""
_CALMNESS = 2.0
"""Weight of squared third differences against squared distances from the path: at 2 m/s, turns of a few decimetres."""
_HELD = 2
"""Waypoints at each end that calming leaves alone: with two, the ends keep their velocity."""
_PATH_STEP = 0.01
"""Distance of points along a smoothed path [m]."""


def find_path(
    occupancy: OccupancyMap, start: Float[Tensor, "3"], goal: Float[Tensor, "3"]
) -> Float[Tensor, "n 3"] | None:
    """The shortest way from start to goal that prefers clearance [m], both included; None where there is none."""
    ends = []
    for point in (start, goal):
        free = occupancy.nearest_free_voxels(point, _SNAP_REACH)
        if len(free) == 0:
            return None
        ends.append(occupancy.index(free[0]))
    voxels = cheapest_path(occupancy.prices, *ends)
    if len(voxels) == 0:
        return None
    return torch.cat([start[None], occupancy.centers(torch.from_numpy(voxels)), goal[None]])


def smooth_path(path: Float[Tensor, "n 3"]) -> Float[Tensor, "m 3"]:
    """The path with rounded corners, its ends as they are, points about 1 cm apart."""
    length = path.diff(dim=0).norm(dim=-1).sum().item()
    dense = resample(path, torch.linspace(0, 1, max(2, round(length / _PATH_STEP)) + 1))
    spread = _SMOOTHING / _PATH_STEP
    reach = min(int(3 * spread), len(dense) - 1)
    weights = torch.exp(-0.5 * (torch.arange(-reach, reach + 1) / spread).square())
    # reflected through the ends, so that these stay where they are and keep their direction
    before = 2 * dense[0] - dense[1 : reach + 1].flip(0)
    after = 2 * dense[-1] - dense[-reach - 1 : -1].flip(0)
    columns = torch.cat([before, dense, after]).T[:, None]
    return torch.nn.functional.conv1d(columns, (weights / weights.sum())[None, None])[:, 0].T


def resample(path: Float[Tensor, "n 3"], shares: Float[Tensor, "m"]) -> Float[Tensor, "m 3"]:
    """Points of a polyline at the given shares of its length, 0 to 1."""
    lengths = path.diff(dim=0).norm(dim=-1).double().numpy()
    reached = np.concatenate([[0.0], np.cumsum(lengths)])
    wanted = shares.double().numpy() * reached[-1]
    columns = [np.interp(wanted, reached, column) for column in path.double().numpy().T]
    return torch.from_numpy(np.stack(columns, -1)).to(path)


def ease(steps: int) -> Float[Tensor, " times"]:
    """Share of the way covered at each time step: minimum jerk (Flash and Hogan, 1985), leaving a little late.

    A robot that must tilt before it can move cannot follow a law that leaves at once.
    """
    late = min(2, steps // 4)
    time = ((torch.arange(steps + 1) - late) / (steps - late)).clamp_min(0)
    return 10 * time**3 - 15 * time**4 + 6 * time**5


def waypoints_along(
    path: Float[Tensor, "n 3"], start: RigidState, goal: RigidState, steps: int
) -> Float[Tensor, "times 4"]:
    """Waypoints (x, y, z [m], yaw [rad]) along a path, eased in and out, turning the shorter way."""
    share = ease(steps)
    before, after = so3.yaw_of(start.rotation), so3.yaw_of(goal.rotation)
    turn = torch.remainder(after - before + torch.pi, 2 * torch.pi) - torch.pi
    positions = calm(resample(path, share))
    return torch.cat([positions, (before + turn * share)[:, None]], -1)


def calm(positions: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
    """The positions near the given ones with small third differences: min_w |w - p|^2 + calmness |D^3 w|^2.

    The two positions at each end stay. (Whittaker's smoothing, 1923.)
    """
    count = len(positions)
    third = torch.eye(count, dtype=torch.float64).diff(dim=0, n=3)
    matrix = torch.eye(count, dtype=torch.float64) + _CALMNESS * third.T @ third
    p = positions.double()
    held = torch.zeros(count, dtype=torch.bool)
    held[:_HELD], held[-_HELD:] = True, True
    wanted = p[~held] - matrix[~held][:, held] @ p[held]
    result = p.clone()
    result[~held] = torch.linalg.solve(matrix[~held][:, ~held], wanted)
    return result.to(positions)

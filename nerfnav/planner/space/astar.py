"""A* search: find paths through the occupancy map, and make them waypoints in time."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from nerfnav.geometry import so3
from nerfnav.planner.kernels import search
from nerfnav.planner.space.occupancy import OccupancyMap
from nerfnav.robots import RigidState, unwrap_angles

_CALMNESS = 2.0
"""Weight of squared third differences against squared distances from the path: at 2 m/s, turns of a few decimetres."""
_HELD = 2
"""Waypoints at each end that calming leaves alone: with two, the ends keep their velocity."""
ROUNDING, TURN, PATH_STEP = 0.06, 0.15, 0.01
"""Of the paper's robots: length over which the corners of a path are rounded, distance that a radian of turning
counts for, and distance of points along a smoothed path [m]. A map's scales have those of others."""
_LARGE = 1 << 18
"""Voxels from which on a search is guided by a coarse map: it pays from there on."""
_NEARLY = 1.1
"""Ratio of the first path's cost to the least there: in open space very many are about as cheap."""
_MORE_GREED, _MOST = (2.0, 4.0), 1 << 17
"""On a large map, a search that looks at more nodes than this begins again with more greed, the last one to its end:
where the cheap way is dangerous, all that costs less than it would be looked at."""
_GREEDIER = 2.0
"""Factor on the greed of later searches where risk makes prices differ much more than the straight line estimates."""


@dataclass(frozen=True)
class SearchConfig:
    """Settings of the path search."""

    ways: int = 5
    """Number of paths, each to keep off the ones before it."""
    detour: float = 3.0
    """Factor on the prices around a path for the next one."""
    berth: float | None = None
    """Reach of these surroundings [m]; None: from the map's scales."""
    greed: float = 1.5
    """Ratio of later paths' costs to the best for their prices that is accepted, so that they are found at once."""
    roundings: tuple[float, ...] = (1.0, 0.5, 2.0)
    """Lengths over which the corners of the shortest path are rounded, a first guess for each, in those of the map's
    scales; other paths take the first."""
    straight: bool = True
    """Try the straight line too."""
    danger: float = 0.0
    """Extra cost of a metre on which noise hits something for certain, in metres in the open, see collision_map.py; 0:
    the paths of a robot without noise. Settings that weigh risk set it themselves."""

    @classmethod
    def single(cls) -> "SearchConfig":
        """Return the settings of the shortest path alone."""
        return cls(ways=1, roundings=(1.0,), straight=False)


def find_path(
    occupancy: OccupancyMap, start: Float[Tensor, "3"], goal: Float[Tensor, "3"]
) -> Float[Tensor, "n 3"] | None:
    """Search the shortest path from start to goal that prefers clearance [m], both included; None where there is none.

    A body with a map for each heading must fit with all of them; with `find_paths` it may turn.
    """
    ends = RigidState.at_rest(start.tolist()), RigidState.at_rest(goal.tolist())
    any_heading, any_dense = (states.any(0, keepdim=True) for states in (occupancy.by_heading, occupancy.dense))
    any_heading_map = replace(occupancy, by_heading=any_heading, dense=any_dense)
    paths = find_paths(any_heading_map, *ends, SearchConfig(ways=1))
    return paths[0][:, :3] if paths else None


def find_paths(
    occupancy: OccupancyMap,
    start: RigidState,
    goal: RigidState,
    config: SearchConfig,
    extra: Float[np.ndarray, "m nx ny nz"] | None = None,
) -> list[Float[Tensor, "_ c"]]:
    """Search paths from start to goal, both included, the shortest first; empty where there is none.

    Rows are x, y, z [m] and, where the map has headings, the heading [rad], without jumps. `extra` is the
    cost of a metre beyond the map's price, in each voxel with each heading.
    """
    ends = [_node(occupancy, start), _node(occupancy, goal)]
    if ends[0] is None or ends[1] is None:
        return []
    key = (*ends[0].tolist(), *ends[1].tolist(), config.ways, config.detour, config.berth, config.greed, config.danger)
    found = None if occupancy.found is None else occupancy.found.get(key)
    if found is None:
        prices = occupancy.prices.copy() if extra is None else occupancy.prices + extra
        found = _searched(occupancy, prices, (ends[0], ends[1]), config)
        if occupancy.found is not None:
            occupancy.found.clear()
            occupancy.found[key] = found
    return [_path(occupancy, nodes, start, goal) for nodes in found]


def _searched(
    occupancy: OccupancyMap, prices: np.ndarray, ends: tuple[np.ndarray, np.ndarray], config: SearchConfig
) -> list[Int[np.ndarray, "_ 4"]]:
    """Search the nodes of each path; prices change."""
    spacing = occupancy.spacing.mean().item()
    turn = occupancy.scales.turn * torch.pi / len(prices) / spacing
    berth = occupancy.scales.berth if config.berth is None else config.berth
    guided = prices.size > _LARGE or config.danger > 0
    guide = search.costs_to(prices, ends[1], True) if guided else np.zeros((0, 0, 0))
    greeds = (_NEARLY if guided else 1.0, config.greed if config.danger == 0 else _GREEDIER * config.greed)
    found = []
    for index in range(config.ways):
        if found and prices.size > _LARGE:
            guide = search.costs_to(prices, ends[1], False)  # prices rose: an old one leads back to the paths before
        nodes = cheapest_path(prices, ends, turn, greeds[min(index, 1)], guide)
        if len(nodes) == 0:
            break
        found.append(nodes)
        search.raise_prices(prices, nodes, max(1, round(berth / spacing)), config.detour)
    return found


def cheapest_path(
    prices: Float[np.ndarray, "m nx ny nz"],
    ends: tuple[np.ndarray, np.ndarray],
    turn: float,
    greed: float,
    guide: Float[np.ndarray, "cx cy cz"],
) -> Int[np.ndarray, "n 4"]:
    """Search as the kernel of this name, with more greed where that takes too long; no row where there is no path."""
    nodes = prices.size * (2 if len(prices) > 1 else 1)
    later = [more for more in _MORE_GREED if more > greed] if prices.size > _LARGE else []
    while True:
        room = np.empty(nodes), np.zeros(nodes, np.uint8)
        path, complete = search.cheapest_path(prices, guide, room, ends, turn, greed, _MOST if later else nodes)
        if complete:
            return path
        greed = later.pop(0)


def _node(occupancy: OccupancyMap, state: RigidState) -> np.ndarray | None:
    """Find the nearest free voxel within reach, and its heading: the state's, or the one nearest to it that fits."""
    count = len(occupancy.by_heading)
    if count == 1:
        tried = [0]
    else:
        own = round(so3.yaw_of(state.rotation).item() * count / torch.pi)
        tried = [(own + change) % (2 * count) for change in sorted(range(-count + 1, count + 1), key=abs)]
    most = occupancy.scales.snap
    beside = min(occupancy.spacing.norm().item(), most)  # nearly always enough, and few voxels are looked at
    for heading in tried:
        for reach in (beside, most):
            free = occupancy.nearest_free_voxels(state.position, reach, heading % count)
            if len(free):
                return np.array([heading, *occupancy.index(free[0])])
    return None


def _path(
    occupancy: OccupancyMap, nodes: np.ndarray, start: RigidState, goal: RigidState
) -> Float[Tensor, "n c"]:
    """Convert a search's nodes to world coordinates between the exact ends."""
    centers = occupancy.centers(torch.from_numpy(nodes[:, 1:]))
    positions = torch.cat([start.position[None], centers, goal.position[None]])
    if len(occupancy.by_heading) == 1:
        return positions
    yaw = torch.from_numpy(nodes[:, 0]) * (torch.pi / len(occupancy.by_heading))
    first, last = so3.yaw_of(start.rotation)[None], so3.yaw_of(goal.rotation)[None]
    return torch.cat([positions, unwrap_angles(torch.cat([first, yaw.to(first), last]))[:, None]], -1)


def smooth_path(
    path: Float[Tensor, "n c"], rounding: float = ROUNDING, turn: float = TURN, step: float = PATH_STEP
) -> Float[Tensor, "m c"]:
    """Round the corners of a path over `rounding` [m]; its ends stay, and points are about `step` [m] apart."""
    pieces = lengths(path, turn)
    shares = torch.linspace(0, 1, max(2, round(pieces.sum().item() / step)) + 1)
    dense = _at_shares(path.numpy(), pieces.numpy(), shares.numpy())
    reach = min(int(3 * rounding / step), len(dense) - 1)
    weights = np.exp(-0.5 * np.square(np.arange(-reach, reach + 1) * (step / rounding)))
    # reflected through the ends, so that these stay where they are and keep their direction
    before = 2 * dense[0] - dense[1 : reach + 1][::-1]
    after = 2 * dense[-1] - dense[-reach - 1 : -1][::-1]
    columns = np.concatenate([before, dense, after]).astype(np.float64).T
    rounded = [np.convolve(column, weights / weights.sum(), mode="valid") for column in columns]
    return torch.from_numpy(np.stack(rounded, -1)).to(path)


def resample(path: Float[Tensor, "n c"], shares: Float[Tensor, "m"], turn: float = TURN) -> Float[Tensor, "m c"]:
    """Resample a polyline at shares of its length, 0 to 1, turns included."""
    return torch.from_numpy(_at_shares(path.numpy(), lengths(path, turn).numpy(), shares.numpy()))


def _at_shares(
    points: Float[np.ndarray, "n c"], pieces: Float[np.ndarray, " pieces"], shares: Float[np.ndarray, " m"]
) -> Float[np.ndarray, "m c"]:
    """Resample a polyline whose points are `pieces` [m] apart."""
    reached = np.concatenate([[0.0], np.cumsum(pieces, dtype=np.float64)])
    wanted = shares.astype(np.float64) * reached[-1]
    return np.stack([np.interp(wanted, reached, column) for column in points.T], -1).astype(points.dtype)


def scale_headings(path: Float[Tensor, "n c"], turn: float = TURN) -> Float[Tensor, "n c"]:
    """Scale the headings of a path, where it has some, to metres."""
    if path.shape[-1] < 4:
        return path
    return path * path.new_tensor([1.0, 1.0, 1.0, turn])


def lengths(path: Float[Tensor, "n c"], turn: float = TURN) -> Float[Tensor, " pieces"]:
    """Measure the distance of each point of a path from the one before it [m], turns included."""
    return scale_headings(path, turn).diff(dim=0).norm(dim=-1)


def late_steps(steps: int) -> int:
    """Return the steps that pass before a robot leaves, of `steps` to its goal: one that must tilt first cannot leave
    at once."""
    return min(2, steps // 4)


@lru_cache(maxsize=64)
def ease(steps: int) -> Float[Tensor, " times"]:
    """Compute the share of the path covered at each time step: minimum jerk (Flash and Hogan, 1985), leaving a
    little late."""
    late = late_steps(steps)
    time = ((torch.arange(steps + 1) - late) / (steps - late)).clamp_min(0)
    return 10 * time**3 - 15 * time**4 + 6 * time**5


def waypoints_along(
    path: Float[Tensor, "n c"],
    start: RigidState,
    goal: RigidState,
    steps: int,
    turn: float = TURN,
    share: Float[Tensor, " times"] | None = None,
) -> Float[Tensor, "times 4"]:
    """Make waypoints (x, y, z [m], yaw [rad]) along a path; headings of the path, or the shorter turn.

    `share` is the share of the path that is covered at each time; None: eased in and out.
    """
    share = ease(steps) if share is None else share
    along = resample(path, share, turn)
    positions = calm(along[:, :3])
    if path.shape[-1] == 4:
        return torch.cat([positions, along[:, 3:]], -1)
    ends = unwrap_angles(torch.stack([so3.yaw_of(start.rotation), so3.yaw_of(goal.rotation)]))
    return torch.cat([positions, (ends[0] + (ends[1] - ends[0]) * share)[:, None]], -1)


def calm(positions: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
    """Smooth positions to small third differences: min_w |w - p|^2 + calmness |D^3 w|^2.

    The two positions at each end stay. (Whittaker's smoothing, 1923.)
    """
    return (_calming(len(positions)) @ positions.double()).to(positions)


@lru_cache(maxsize=64)
def _calming(count: int) -> Float[Tensor, "n n"]:
    """Compute the matrix of `calm` for so many positions: it is linear in them."""
    third = torch.eye(count, dtype=torch.float64).diff(dim=0, n=3)
    matrix = torch.eye(count, dtype=torch.float64) + _CALMNESS * third.T @ third
    held = torch.zeros(count, dtype=torch.bool)
    held[:_HELD], held[-_HELD:] = True, True
    wanted = torch.eye(count, dtype=torch.float64)
    wanted[~held] -= matrix[~held] * held
    wanted[~held] = torch.linalg.solve(matrix[~held][:, ~held], wanted[~held])
    return wanted

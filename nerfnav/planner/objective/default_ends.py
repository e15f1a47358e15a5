"""Default start and goal: propose two free poses with a path between them, from which the camera sees something.

Candidates are voxels of the component, drawn at random. Of their pairs those are best that are as far apart as suits
robot and place, that have something solid between them, and from which a camera sees something: a robot that flies by
its camera is lost in front of the void. And they keep clear of what noise would push the robot into before any action
can answer.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float

from nerfnav.field import Field, density_at
from nerfnav.geometry import so3
from nerfnav.planner.active_yaw import wrap_yaw
from nerfnav.planner.space.astar import SearchConfig, find_paths, lengths, resample
from nerfnav.planner.space.border import holds_level
from nerfnav.planner.space.ends import fits
from nerfnav.planner.space.ground import settle_ends
from nerfnav.planner.space.occupancy import OccupancyMap, dense_at
from nerfnav.planner.space.regions import Region, free_regions, ground_regions
from nerfnav.planner.space.scales import threshold_of
from nerfnav.planner.visibility import measure_visibility
from nerfnav.robots import PAPER_NOISE, RigidState, Robot

Pair = tuple[RigidState, RigidState]

_ALONG = 32
"""Densities taken between the two of a pair."""
_NEAREST = 0.6
"""Least distance of a pair, as a share of the wanted one."""
_SAFE = 0.05
"""Bound on the probability of a collision along a path with which no better one is searched."""
_LIKELY = 0.4
"""Bound from which on a path does not count."""
_CRAMPED = 0.39
"""Largest bound with the noise at the ends included: a place without room has ends all the same."""
_PUSHED = 3.0
"""Standard deviations of noise by which robots are pushed to see what they would touch at an end."""


@dataclass(frozen=True)
class ProposedEndsConfig:
    """Distances that suit a robot, and effort of the search."""

    longest: float = 25.0
    """Longest wanted distance [lengths of the body]."""
    shortest: float = 5.0
    """Shortest useful distance [lengths of the body]."""
    share: float = 0.45
    """Wanted distance, as a share of the place's horizontal diagonal."""
    candidates: int = 128
    """Number of voxels that are drawn."""
    headings: int = 8
    """Number of headings at which visibility is measured from each."""
    tried: int = 24
    """Largest number of pairs for which a path is searched."""
    seed: int = 0
    """Seed of the draw."""


def propose_ends(
    field: Field, matter: Field, robot: Robot, map_at: Callable[[float], OccupancyMap],
    config: ProposedEndsConfig | None = None,
) -> Pair | None:  # fmt: skip
    """Propose two states at rest that a robot can plan between; None where it has no room.

    `field` is the one to plan in, `matter` the same as it was learned; `map_at` gives the map of free space, of one
    height [m] for a robot on the ground and of any for others.
    """
    config = ProposedEndsConfig() if config is None else config
    regions = ground_regions(matter, robot.body, map_at) if robot.planar else free_regions(map_at(0.0))
    wide = (region for region in regions if region.extent >= config.shortest * max(robot.body.extents[:2]))
    return _safest((_pair_in(region, field, matter, robot, config) for region in wide), _LIKELY).pair


@dataclass(frozen=True)
class _Judged:
    """Pair, if there is one, and the risk of the path between its ends."""

    pair: Pair | None
    risk: float


def _safest(found: Iterable[_Judged], most: float) -> _Judged:
    """Return the pair with the smallest risk, if that is below `most`; a safe one ends the search."""
    best = _Judged(None, most)
    for judged in found:
        if judged.risk < best.risk:
            best = judged
        if judged.risk < _SAFE:
            break
    return best


def path_between(occupancy: OccupancyMap, pair: Pair) -> Float[torch.Tensor, "n c"] | None:
    """Search the shortest path between two states, its rows as of `find_paths`; None where there is none.
    """
    paths = find_paths(occupancy, *pair, SearchConfig.single())
    return paths[0] if paths else None


def _pair_in(
    region: Region, field: Field, matter: Field, robot: Robot, config: ProposedEndsConfig
) -> _Judged:
    """Find the best pair of a region that fits, with its headings, and the risk of the path between them."""
    occupancy, rounding = region.occupancy, 10**region.occupancy.scales.decimals
    generator = np.random.default_rng(config.seed)
    cells = np.flatnonzero(region.inside)
    cells = generator.choice(cells, min(len(cells), config.candidates), replace=False)
    index = torch.from_numpy(np.stack(np.unravel_index(np.sort(cells), region.inside.shape), -1))
    points = occupancy.centers(index)
    rounded = (points * rounding).round() / rounding
    points = torch.cat([rounded[:, :2], points[:, 2:] if robot.planar else rounded[:, 2:]], -1)
    points = points[holds_level(field.box, robot.body, points)]
    if len(points) < 2:
        return _Judged(None, np.inf)
    seen = measure_visibility(matter, points, torch.arange(config.headings) * (2 * torch.pi / config.headings))
    apart = _distance_wanted(region, field, robot, config)

    def judged() -> Iterator[_Judged]:
        for one, other in _ranked(points, seen, matter, apart, config):
            pair = _with_headings(points[one], points[other], (seen[one], seen[other]), occupancy, robot)
            if pair and _may_stand(pair, field, matter, robot, occupancy.scales.threshold):
                risk = _risk_between(pair, field, robot, occupancy)
                yield _Judged(pair, max(risk, min(risk + _risk_at(pair, field, robot, occupancy), _CRAMPED)))

    return _safest(judged(), np.inf)


def _may_stand(pair: Pair, field: Field, matter: Field, robot: Robot, threshold: float) -> bool:
    """Check that the body fits at both ends, and that a floor carries a robot on the ground."""
    carried = all(not support.footing.is_refused for support in settle_ends(matter, field, robot, *pair))
    return carried and all(fits(field, robot.body, state, threshold) for state in pair)


def _risk_at(pair: Pair, field: Field, robot: Robot, occupancy: OccupancyMap) -> float:
    """Compute the share of pushes along the axes, forth and back, that bring the body into something at either end."""
    away = _PUSHED * PAPER_NOISE.process.position_m * torch.eye(3)[: 2 if robot.planar else 3]
    pushed = [replace(end, position=end.position + push) for end in pair for push in torch.cat([away, -away])]
    return sum(not fits(field, robot.body, state, occupancy.scales.threshold) for state in pushed) / len(pushed)


def _risk_between(pair: Pair, field: Field, robot: Robot, occupancy: OccupancyMap) -> float:
    """Bound the probability of a collision along the path that is found (Eq. 1), with its turns."""
    path = path_between(occupancy, pair)
    assert path is not None, "only pairs with a path between them are compared"
    pieces = lengths(path[:, :3])
    count = int(pieces.sum() / occupancy.scales.path_step) + 2
    along = resample(path[:, :3], torch.linspace(0, 1, count))
    ahead = along.diff(dim=0)
    yaws = torch.atan2(ahead[:, 1], ahead[:, 0]) if robot.planar else torch.zeros(len(ahead))
    points = torch.einsum("nij,bj->nbi", so3.from_yaw(yaws), robot.body.points_body) + along[1:, None]
    density = density_at(field, points.reshape(-1, 3).double().numpy())
    return float((density.reshape(len(ahead), -1).sum(-1) * ahead.norm(dim=-1).numpy()).sum())


def _distance_wanted(region: Region, field: Field, robot: Robot, config: ProposedEndsConfig) -> float:
    """Compute the wanted distance of a region [m]."""
    length = max(robot.body.extents[:2])
    diagonal = float(field.box.size[:2].norm())
    return max(config.shortest * length, min(config.share * diagonal, 0.7 * region.extent, config.longest * length))


def _ranked(
    points: Float[torch.Tensor, "n 3"], seen: Float[np.ndarray, "n h"], matter: Field, apart: float,
    config: ProposedEndsConfig,
) -> list[tuple[int, int]]:  # fmt: skip
    """Rank pairs of candidates, the best first."""
    first, second = np.triu_indices(len(points), 1)
    difference = (points[second] - points[first]).numpy()
    distance = np.linalg.norm(difference, axis=-1)
    best = seen.max(1)
    value = best[first] + best[second] - np.abs(distance - apart) / apart
    value -= 0.5 * np.abs(difference[:, 2]) / distance.clip(1e-9)
    value[distance < _NEAREST * apart] = -np.inf
    order = np.argsort(-value, kind="stable")[: 16 * config.tried]
    order = order[np.isfinite(value[order])]
    if len(order) == 0:
        return []
    shares = torch.linspace(0, 1, _ALONG)[:, None]
    starts, ends = points[first[order]][:, None], points[second[order]][:, None]
    between = dense_at(matter, starts + shares * (ends - starts), threshold_of(matter)).any(-1).numpy()
    order = order[np.argsort(-(value[order] + 0.4 * between), kind="stable")][: config.tried]
    return list(zip(first[order].tolist(), second[order].tolist(), strict=True))


def _with_headings(
    start: Float[torch.Tensor, "3"], goal: Float[torch.Tensor, "3"], seen: tuple[np.ndarray, np.ndarray],
    occupancy: OccupancyMap, robot: Robot,
) -> Pair | None:  # fmt: skip
    """Give two points headings, if there is a path: along it for a robot on the ground, else to the best view.
    """
    level = RigidState.at_rest(start.tolist(), 0.0), RigidState.at_rest(goal.tolist(), 0.0)
    path = path_between(occupancy, level)
    if path is None:
        return None
    yaws = _along(path[:, :3], occupancy.scales.width) if robot.planar else _toward_most(*seen)
    pair = RigidState.at_rest(start.tolist(), yaws[0]), RigidState.at_rest(goal.tolist(), yaws[1])
    return pair if not robot.planar or path_between(occupancy, pair) is not None else None


def _along(path: Float[torch.Tensor, "n 3"], width: float) -> tuple[float, float]:
    """Compute the headings in which a path leaves and arrives, over three widths of the body [rad]."""
    reached = torch.cat([torch.zeros(1), lengths(path).cumsum(0)])
    leaves = path[int((reached < 3 * width).sum().clamp_max(len(path) - 1))] - path[0]
    arrives = path[-1] - path[int((reached <= reached[-1] - 3 * width).sum().clamp_min(1)) - 1]
    return tuple(round(float(torch.atan2(part[1], part[0])), 4) for part in (leaves, arrives))  # type: ignore[return-value]


def _toward_most(start: np.ndarray, goal: np.ndarray) -> tuple[float, float]:
    """Choose the headings with the best views [rad]; half a turn between them costs half of the best view from
    either."""
    count, most = len(start), max(start.max(), goal.max(), 1e-9)
    turn = np.arange(count)[None] - np.arange(count)[:, None]
    turn = np.abs((turn + count // 2) % count - count // 2) / (count / 2)
    best = int(((start[:, None] + goal[None]) / most - 0.5 * turn).argmax())
    first, last = (round(wrap_yaw(heading * 2 * np.pi / count), 4) for heading in divmod(best, count))
    return first, last

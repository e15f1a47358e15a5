"""Paths around things, and waypoints along paths."""

import heapq
import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import torch

from nerfnav import robots
from nerfnav.planner.kernels.search import CLUSTER, costs_to, raise_prices
from nerfnav.planner.kernels.search import cheapest_path as kernel_path
from nerfnav.planner.space import astar
from nerfnav.planner.space.astar import (
    SearchConfig,
    _node,
    calm,
    cheapest_path,
    ease,
    find_path,
    find_paths,
    resample,
    smooth_path,
    waypoints_along,
)
from nerfnav.planner.space.occupancy import OccupancyConfig, OccupancyMap
from nerfnav.robots.state import RigidState
from tests.planner.places import ROBOT, Wall, ball

COARSE = OccupancyConfig(voxel=0.05)
UNGUIDED = np.zeros((0, 0, 0))


def dijkstra(prices: np.ndarray, start: tuple[int, ...], goal: tuple[int, ...]) -> float:
    """The cost of the cheapest path, without any heuristic and in plain Python."""
    cost, queue = {start: 0.0}, [(0.0, start)]
    while queue:
        spent, node = heapq.heappop(queue)
        if node == goal:
            return spent
        for move in np.ndindex(3, 3, 3):
            other = tuple(n + m - 1 for n, m in zip(node, move, strict=True))
            if all(0 <= o < size for o, size in zip(other, prices.shape, strict=True)):
                total = spent + 0.5 * math.dist(node, other) * float(prices[node] + prices[other])
                if total < cost.get(other, math.inf):
                    cost[other] = total
                    heapq.heappush(queue, (total, other))
    return math.inf


def cost_of(path: np.ndarray, prices: np.ndarray) -> float:
    steps = pairwise(path)
    return sum(0.5 * math.dist(a, b) * float(prices[tuple(a)] + prices[tuple(b)]) for a, b in steps)


@pytest.mark.parametrize("seed", range(6))
def test_no_path_is_cheaper_than_the_one_found(seed: int):
    generator = np.random.default_rng(seed)
    prices = 1 + 4 * generator.random((9, 8, 7))
    prices[generator.random(prices.shape) < 0.4] = np.inf
    start, goal = (0, 0, 0), (8, 7, 6)
    prices[start] = prices[goal] = 1
    path = cheapest_path(prices[None], (np.array([0, *start]), np.array([0, *goal])), 0.0, 1.0, UNGUIDED)[:, 1:]
    expected = dijkstra(prices, start, goal)
    if math.isinf(expected):
        assert len(path) == 0
        return
    assert tuple(path[0]) == start and tuple(path[-1]) == goal
    assert np.abs(np.diff(path, axis=0)).max() == 1
    assert cost_of(path, prices) == pytest.approx(expected, rel=1e-6)


def test_a_path_from_a_voxel_to_itself_is_that_voxel():
    node = np.array([0, 1, 1, 1])
    path = cheapest_path(np.ones((1, 3, 3, 3)), (node, node), 0.0, 1.0, UNGUIDED)
    assert path.tolist() == [[0, 1, 1, 1]]


def test_a_path_leads_through_the_door():
    occupancy = OccupancyMap.of(Wall(door=0.4), ROBOT.body, COARSE)
    start, goal = torch.tensor([-0.7, -0.5, 0.4]), torch.tensor([0.7, -0.5, 0.4])
    path = find_path(occupancy, start, goal)
    assert path is not None
    assert torch.equal(path[0], start) and torch.equal(path[-1], goal)
    crossing = path[path[:, 0].abs() < 0.06]
    assert len(crossing) > 0 and ((crossing[:, 1] - 0.5).abs() < 0.16).all()


def test_there_is_no_path_through_a_wall_without_a_door():
    occupancy = OccupancyMap.of(Wall(door=0.0), ROBOT.body, COARSE)
    assert find_path(occupancy, torch.tensor([-0.7, 0.0, 0.4]), torch.tensor([0.7, 0.0, 0.4])) is None


def test_there_is_no_path_from_deep_inside_a_stone():
    occupancy = OccupancyMap.of(ball(0.5), ROBOT.body, COARSE)
    assert find_path(occupancy, torch.tensor([0.0, 0.0, 0.4]), torch.tensor([0.9, 0.9, 0.4])) is None


def test_clearance_makes_a_path_keep_its_distance():
    start, goal = torch.tensor([-0.7, 0.0, 0.4]), torch.tensor([0.7, 0.0, 0.4])
    nearest = []
    for weight in (0.0, 10.0):
        config = OccupancyConfig(voxel=0.05, clearance=0.2, clearance_weight=weight)
        path = find_path(OccupancyMap.of(ball(), ROBOT.body, config), start, goal)
        assert path is not None
        nearest.append((path - torch.tensor([0.0, 0.0, 0.4])).norm(dim=-1).min().item())
    assert nearest[1] > nearest[0] + 0.04


def test_smoothing_keeps_the_ends_and_rounds_the_corners():
    corner = torch.tensor([[0.0, 0, 0], [0.5, 0, 0], [0.5, 0.5, 0]])
    smooth = smooth_path(corner)
    torch.testing.assert_close(smooth[[0, -1]], corner[[0, -1]], rtol=0, atol=1e-5)
    assert 0.02 < (smooth - corner[1]).norm(dim=-1).min() < 0.06
    headings = torch.nn.functional.normalize(smooth.diff(dim=0), dim=-1)
    assert (headings[1:] * headings[:-1]).sum(-1).min() > math.cos(0.15)


@pytest.mark.parametrize("length", [0.0, 0.004, 0.05])
def test_smoothing_takes_paths_of_any_length(length: float):
    smooth = smooth_path(torch.tensor([[0.0, 0, 0], [length, 0, 0]]))
    torch.testing.assert_close(smooth[-1], torch.tensor([length, 0, 0]), rtol=0, atol=1e-6)
    assert torch.isfinite(smooth).all()


def test_resampling_walks_along_the_line():
    path = torch.tensor([[0.0, 0, 0], [1, 0, 0], [1, 3, 0]])
    points = resample(path, torch.tensor([0.0, 0.125, 0.25, 0.5, 1.0]))
    expected = torch.tensor([[0.0, 0, 0], [0.5, 0, 0], [1, 0, 0], [1, 1, 0], [1, 3, 0]])
    torch.testing.assert_close(points, expected)


@pytest.mark.parametrize("steps", [1, 4, 20, 40])
def test_easing_starts_and_ends_at_rest(steps: int):
    share = ease(steps)
    assert share[0] == 0 and share[-1].item() == pytest.approx(1)
    assert (share.diff() >= 0).all()
    if steps >= 20:
        assert share[1:4].max() < 0.01 and share[-2] > 0.99


def test_waypoints_turn_the_shorter_way():
    start, goal = RigidState.at_rest((0, 0, 0), 3.0), RigidState.at_rest((1, 0, 0), -3.0)
    waypoints = waypoints_along(torch.stack([start.position, goal.position]), start, goal, 20)
    assert waypoints.shape == (21, 4)
    assert waypoints[-1, 3].item() == pytest.approx(2 * math.pi - 3, abs=1e-5)
    torch.testing.assert_close(waypoints[[0, -1], :3], torch.stack([start.position, goal.position]))


def test_calming_keeps_the_ends_and_what_is_calm_already():
    time = torch.linspace(0, 1, 21)[:, None]
    parabola = torch.cat([time, time**2, 1 - time], -1)
    torch.testing.assert_close(calm(parabola), parabola, rtol=0, atol=1e-5)
    jagged = parabola + 0.1 * torch.randn(21, 3, generator=torch.Generator().manual_seed(0))
    calmed = calm(jagged)
    assert torch.equal(calmed[[0, -1]], jagged[[0, -1]])
    assert calmed.diff(n=3, dim=0)[2:-2].norm() < 0.3 * jagged.diff(n=3, dim=0)[2:-2].norm()


def test_greed_finds_a_way_that_costs_at_most_so_much_more():
    generator = np.random.default_rng(3)
    prices = 1 + 4 * generator.random((1, 14, 13, 12))
    ends = np.array([0, 0, 0, 0]), np.array([0, 13, 12, 11])
    best, quick = (
        cost_of(cheapest_path(prices, ends, 0.0, greed, UNGUIDED)[:, 1:], prices[0]) for greed in (1.0, 1.5)
    )
    assert best <= quick <= 1.5 * best


@pytest.mark.parametrize("is_open", [True, False])
def test_a_search_that_takes_too_long_begins_again_with_more_greed(is_open: bool, monkeypatch: pytest.MonkeyPatch):
    prices = np.ones((1, 40, 40, 20))
    prices[0, 20] = np.inf
    prices[0, 20, 18:22, 8:12] = 400.0 if is_open else np.inf  # the only door is dangerous
    ends = np.array([0, 5, 20, 10]), np.array([0, 35, 20, 10])
    least = cheapest_path(prices, ends, 0.0, 1.0, UNGUIDED)
    tried = []

    def noted(*arguments: Any) -> Any:
        found = kernel_path(*arguments)
        tried.append((arguments[5], found[1], np.count_nonzero(arguments[2][1] & 128)))
        return found

    monkeypatch.setattr(astar.search, "cheapest_path", noted)
    monkeypatch.setattr(astar, "_LARGE", 1000)
    monkeypatch.setattr(astar, "_MOST", 2000)
    path = cheapest_path(prices, ends, 0.0, 1.1, UNGUIDED)
    assert [(greed, complete) for greed, complete, _ in tried] == [(1.1, False), (2.0, False), (4.0, True)]
    assert all(closed <= 2000 for _, complete, closed in tried if not complete)
    assert (len(path) > 0) is is_open
    assert not is_open or cost_of(path[:, 1:], prices[0]) <= 4 * cost_of(least[:, 1:], prices[0])


@pytest.mark.parametrize("seed", range(4))
def test_a_coarse_map_guides_to_the_cheapest_way(seed: int):
    generator = np.random.default_rng(seed)
    prices = np.ones((1, 42, 31, 18))
    for wall in (10, 20, 30):  # each with one hole
        prices[0, wall] = np.inf
        y, z = generator.integers(2, 28), generator.integers(2, 15)
        prices[0, wall, y : y + 2, z : z + 2] = 1
    ends = np.array([0, 1, 1, 1]), np.array([0, 40, 29, 16])
    straight, guided = (
        cost_of(cheapest_path(prices, ends, 0.0, 1.0, guide)[:, 1:], prices[0])
        for guide in (UNGUIDED, costs_to(prices, ends[1], True))
    )
    assert guided == pytest.approx(straight, rel=1e-3)


def test_on_a_large_map_the_guide_of_a_later_way_knows_the_prices_around_earlier_ones(monkeypatch: pytest.MonkeyPatch):
    guides = []

    def noted(prices: np.ndarray, goal: np.ndarray, least: bool) -> np.ndarray:
        guides.append(costs_to(prices, goal, least))
        return guides[-1]

    monkeypatch.setattr(astar, "_LARGE", 1000)
    monkeypatch.setattr(astar.search, "costs_to", noted)
    occupancy = OccupancyMap.of(Wall(door=0.5), ROBOT.body, COARSE)
    start, goal = RigidState.at_rest((-0.7, 0.0, 0.4)), RigidState.at_rest((0.7, 0.0, 0.4))
    find_paths(occupancy, start, goal, SearchConfig(ways=3, berth=0.4))
    at = tuple(int(index) // CLUSTER for index in occupancy.index(start.position))
    before = [guide[at] for guide in guides]
    assert before[0] < before[1] < before[2]


def test_later_ways_among_raised_prices_are_found_without_a_search_of_the_whole_map():
    ends = np.array([0, 20, 40, 20]), np.array([0, 50, 40, 20])
    looked = []
    for least in (True, False):
        prices, count = np.ones((1, 80, 80, 40)), 0
        for way in range(5):
            moves = np.zeros(prices.size, np.uint8)
            guide = costs_to(prices, ends[1], way == 0 or least)
            room, greed = (np.empty(prices.size), moves), 3.0 if way else 1.1
            path, complete = kernel_path(prices, guide, room, ends, 0.0, greed, prices.size)
            assert complete
            raise_prices(prices, path, 3, 3.0)
            count += np.count_nonzero(moves)
            assert 0 < len(path) < 60
        looked.append(count)
    assert looked[1] < 0.5 * looked[0]


def test_the_mean_price_of_a_coarse_voxel_leaves_walls_out():
    prices = np.full((1, CLUSTER, CLUSTER, 2 * CLUSTER), np.inf)
    prices[0, 0, 0, :2], prices[0, 0, 0, CLUSTER : CLUSTER + 2] = (1, 3), (5, 7)
    costs = costs_to(prices, np.zeros(4, int), False)
    assert costs[0, 0].tolist() == [0, 0.5 * CLUSTER * (2 + 6)]


def test_later_ways_keep_off_the_ones_before_them():
    occupancy = OccupancyMap.of(ball(0.3), ROBOT.body, COARSE)
    start, goal = RigidState.at_rest((-0.8, 0.0, 0.4)), RigidState.at_rest((0.8, 0.0, 0.4))
    first, second, *_ = find_paths(occupancy, start, goal, SearchConfig())
    middle = [path[path[:, 0].abs().argmin(), 1:] for path in (first, second)]
    assert (middle[0] - middle[1]).norm() > 0.2


def test_a_long_body_turns_on_its_way_through_a_door_and_back_again():
    couch, across = robots.load("couch"), math.pi / 2
    occupancy = OccupancyMap.of(Wall(door=0.28, thickness=0.05), couch.body, OccupancyConfig(), 0.4)
    start, goal = RigidState.at_rest((-0.7, 0.4, 0.4), across), RigidState.at_rest((0.7, 0.4, 0.4), across)
    (path,) = find_paths(occupancy, start, goal, SearchConfig.single())
    assert path[0, 3] == pytest.approx(across) and path[-1, 3] == pytest.approx(across, abs=1e-5)
    inside = path[path[:, 0].abs() < 0.05]
    assert len(inside) and torch.sin(inside[:, 3]).abs().max() < 0.5
    assert path[:, 3].diff().abs().max() < 0.5  # without jumps
    assert (path[:, 2] == 0.4).all()
    waypoints = waypoints_along(smooth_path(path), start, goal, 30)
    assert waypoints[:, 3].min() < 0.6 < across - 0.1 < waypoints[-1, 3]
    assert find_path(occupancy, start.position, goal.position) is None  # not with whatever heading


def test_a_search_begins_at_the_nearest_of_all_free_voxels_within_reach() -> None:
    occupancy = OccupancyMap.of(ball(), ROBOT.body, OccupancyConfig(voxel=0.05))
    draws = np.random.default_rng(0)
    for point in draws.uniform((-0.4, -0.4, 0.1), (0.4, 0.4, 0.7), (60, 3)).tolist():
        there = RigidState.at_rest((point[0], point[1], point[2]))
        all_free = occupancy.nearest_free_voxels(there.position, occupancy.scales.snap)
        node = _node(occupancy, there)
        assert (node is None) == (len(all_free) == 0)
        if node is not None:
            assert node.tolist() == [0, *occupancy.index(all_free[0]).tolist()]

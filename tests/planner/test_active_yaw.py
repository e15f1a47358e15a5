"""Robots that turn to see something, evenly or as it comes, and searches that leave headings as they are."""

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
import torch
from torch import Tensor

from nerfnav.core.steps import run_steps
from nerfnav.field.models.voxel import VoxelField
from nerfnav.geometry import so3
from nerfnav.planner.active_yaw import (
    _MOVES,
    _TURNING,
    YawObjective,
    _cheapest,
    _mean_variance,
    choose_goal_heading,
    choose_headings,
    limit_yaw_rate,
)
from nerfnav.planner.objective.problem import PlanProblem
from nerfnav.planner.solvers.fast import FastPlanConfig, replan_fast
from nerfnav.planner.solvers.warm_start import shift_warm_start
from nerfnav.planner.trajectory import Trajectory
from nerfnav.planner.visibility import VIEW_HEADINGS, VisibilityProfile
from nerfnav.robots import Couch, Motion, Quadrotor, RigidState
from tests.planner.objective.test_default_ends import field_of

_ROBOT = Quadrotor()
_PLACE = ((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0))
_BEHIND: VoxelField = field_of(_PLACE, ((-1.0, -1.0, -1.0), (-0.6, 1.0, 1.0)), spacing=0.05)
"""A wall in the west alone."""


def turned(
    places: Tensor, ends: tuple[RigidState, RigidState], may_be: Callable[[RigidState], bool] | None = None,
    enough: float = 0.4, field: VoxelField = _BEHIND,
) -> RigidState:  # fmt: skip
    objective = YawObjective(field, enough, may_be=may_be)
    way = RigidState.stack([replace(ends[0], position=place) for place in places])
    return choose_goal_heading(objective, objective.profile_along(way), ends)


def arriving(start: float, goal: float, enough: float = 0.4, field: VoxelField = _BEHIND) -> float:
    """Heading of the end of a way from south to north through the middle, for headings at its ends."""
    way = torch.tensor([[0.0, -0.8, 0.0], [0.0, 0.8, 0.0]])
    first, last = (RigidState.at_rest((0.0, y, 0.0), yaw) for y, yaw in ((-0.8, start), (0.8, goal)))
    path = way[0] + torch.linspace(0, 1, 21)[:, None] * (way[1] - way[0])
    end = turned(path, (first, last), enough=enough, field=field)
    assert torch.equal(end.position, last.position)
    return so3.yaw_of(end.rotation).item()


@pytest.mark.parametrize("yaw", [3.0, -3.0])
def test_a_robot_that_sees_enough_on_its_way_keeps_its_heading(yaw: float) -> None:
    assert arriving(yaw, yaw) == pytest.approx(yaw, abs=1e-5)


@pytest.mark.parametrize("yaw", [0.3, -0.3])
def test_a_robot_that_would_look_into_the_void_turns_to_what_there_is(yaw: float) -> None:
    assert abs(arriving(yaw, yaw)) > 2
    assert abs(arriving(math.pi, yaw)) > abs(yaw), "it turns back to the void late, and not quite"


def test_it_turns_where_it_sees_more_on_the_way_not_only_at_the_end() -> None:
    west, south = ((-1.0, -1.0, -1.0), (-0.6, 1.0, 1.0)), ((-1.0, -1.0, -1.0), (1.0, -0.9, 1.0))
    corner = field_of(_PLACE, west, south, spacing=0.05)
    assert arriving(-0.3, 0.0, field=corner) < -1, "past the wall in the south, not past the void in the north"


def test_a_robot_that_watches_looks_where_it_flies() -> None:
    around = field_of(
        _PLACE, ((-1.0, -1.0, -1.0), (-0.6, 1.0, 1.0)), ((0.6, -1.0, -1.0), (1.0, 1.0, 1.0)), spacing=0.05
    )
    north = field_of(_PLACE, ((-1.0, -1.0, -1.0), (-0.6, 1.0, 1.0)), ((-1.0, 0.9, -1.0), (1.0, 1.0, 1.0)), spacing=0.05)
    path = RigidState.stack([RigidState.at_rest((0.0, y, 0.0)) for y in (-0.8, 0.0, 0.8)])
    for field in (around, north):
        usual, watching = (
            YawObjective(field, 0.1, looks_ahead=ahead).profile_along(path).seen for ahead in (False, True)
        )
        ahead, back = VIEW_HEADINGS // 4, 3 * VIEW_HEADINGS // 4
        assert np.allclose(watching[:, ahead], usual[:, ahead]) and np.allclose(watching[:, back], 0.1 * usual[:, back])
        assert (watching <= usual + 1e-9).all()


def test_of_the_headings_in_which_something_is_seen_it_takes_one_with_which_it_may_be_there() -> None:
    way = torch.tensor([[0.0, -0.8, 0.0], [0.0, 0.8, 0.0]])
    ends = RigidState.at_rest((0.0, -0.8, 0.0), 0.0), RigidState.at_rest((0.0, 0.8, 0.0), 0.0)
    free = so3.yaw_of(turned(way, ends).rotation).item()
    north = turned(way, ends, lambda end: so3.yaw_of(end.rotation).item() * free < 0)
    assert abs(free) > 2 and so3.yaw_of(north.rotation).item() * free < 0
    nowhere = turned(way, ends, lambda _: False)
    assert torch.equal(nowhere.rotation, ends[1].rotation)


def test_nothing_to_be_seen_changes_nothing() -> None:
    assert arriving(0.5, 0.7, field=field_of(_PLACE, spacing=0.1)) == pytest.approx(0.7, abs=1e-5)


def test_to_see_nothing_for_long_is_worse_than_to_see_nothing_now_and_then() -> None:
    blind_at_once, by_turns = (
        _mean_variance(np.array(shown, dtype=float)[:, None])[0] for shown in ([1, 1, 1, 0, 0, 0], [0, 1, 0, 1, 0, 1])
    )
    assert blind_at_once == pytest.approx(1.0) and by_turns == pytest.approx(0.5)


def test_the_cheapest_headings_are_those_of_all_that_there_are() -> None:
    generator = np.random.default_rng(1)
    blind, last = generator.random((5, 7)), generator.random(7)
    moves, cost = _cheapest(blind, last)

    def price(tried: tuple[int, ...]) -> float:
        at = np.concatenate([[0], np.cumsum(tried)]) % 7
        return blind[np.arange(5), at].sum() + last[at[-1]] + _TURNING * np.square(tried).sum()

    every = {(*tried, 0): price((*tried, 0)) for tried in product(_MOVES.tolist(), repeat=3)}
    assert price(tuple(moves)) == pytest.approx(cost) == pytest.approx(min(every.values()))


def planned(yaw: float, steps: int = 16) -> tuple[Motion, tuple[RigidState, RigidState]]:
    """A way from south to north that begins and ends with a heading."""
    ends = RigidState.at_rest((0.0, -0.6, 0.0), yaw), RigidState.at_rest((0.0, 0.6, 0.0), yaw)
    return run_steps(replan_fast(PlanProblem(_BEHIND, _ROBOT, *ends, steps), straight(*ends, steps))).motion, ends


def straight(start: RigidState, goal: RigidState, steps: int) -> Trajectory:
    """Where a search for it begins."""
    share = torch.linspace(0, 1, steps + 1)[:, None]
    places = start.position + share * (goal.position - start.position)
    way = RigidState.stack([replace(start, position=place) for place in places])
    still = torch.tensor([_ROBOT.weight, 0.0, 0.0, 0.0]).expand(steps, 4)
    return shift_warm_start(Motion(way, still, 0.1), start, goal, _ROBOT, executed=0, steps=steps)


def test_a_robot_that_would_see_nothing_for_long_turns_at_once_and_one_that_sees_enough_does_not() -> None:
    motion, (start, goal) = planned(0.0)
    objective = YawObjective(_BEHIND, 0.4)
    profile = objective.profile_along(motion.states)
    end = choose_goal_heading(objective, profile, (start, goal))
    better = choose_headings(objective, profile, motion, (start, goal, end), _ROBOT)
    assert better is not None
    yaws, times = so3.yaw_of(better.states.rotation).double().numpy(), np.linspace(0, 1, 17)
    even = so3.yaw_of(end.rotation).item() * times
    assert yaws[:2] == pytest.approx(0.0, abs=1e-5)
    assert (1 - profile.at(times, yaws)).sum() < (1 - profile.at(times, even)).sum() - 0.5
    assert np.abs(np.diff(np.unwrap(yaws))).max() < 0.45
    torch.testing.assert_close(better.states.position[4:], motion.states.position[4:])
    assert (better.states.position - motion.states.position).norm(dim=-1).max() < 0.05
    looking, (start, goal) = planned(math.pi)
    profile = objective.profile_along(looking.states)
    assert choose_headings(objective, profile, looking, (start, goal, goal), _ROBOT) is None


def test_a_goal_has_the_heading_whose_pictures_leave_the_least_variance_where_a_path_shows_enough_at_any() -> None:
    motion, (start, goal) = planned(math.pi)
    left = np.ones(8)
    left[3] = 0.1
    objective = YawObjective(_BEHIND, 0.4, remainder=left)
    profile = VisibilityProfile(np.ones((2, VIEW_HEADINGS)))
    end = choose_goal_heading(objective, profile, (start, goal))
    assert so3.yaw_of(end.rotation).item() == pytest.approx(3 * math.tau / 8, abs=0.01)
    turned = choose_headings(objective, profile, motion, (start, goal, goal), _ROBOT)
    assert turned is not None
    assert so3.yaw_of(turned.states.rotation[-1]).item() == pytest.approx(3 * math.tau / 8, abs=0.2)


def test_a_robot_that_tilts_sees_what_its_camera_sees_then() -> None:
    """Pitched up by 60 degrees before a wall of 2 m, a camera of 90 degrees sees above it what it is not."""
    level = RigidState.at_rest((0.0, 0.0, 0.6), yaw=math.pi)
    back = so3.from_yaw(torch.tensor(math.pi)) @ so3.exp(torch.tensor([0.0, -math.pi / 3, 0.0]))
    tilted = replace(level, rotation=back)
    objective, west = YawObjective(_BEHIND, 0.4), np.array([math.pi])
    ways = (RigidState.stack([state] * 5) for state in (level, tilted))
    seen, seen_then = (objective.profile_along(way).at(np.array([0.5]), west) for way in ways)
    assert seen > 0.9 and seen_then < 0.5 * seen


def test_of_headings_that_show_more_it_ends_with_one_with_which_it_may_be_there() -> None:
    motion, (start, goal) = planned(0.0)
    profile = YawObjective(_BEHIND, 0.4).profile_along(motion.states)
    free = choose_headings(YawObjective(_BEHIND, 0.4), profile, motion, (start, goal, goal), _ROBOT)
    assert free is not None
    side = so3.yaw_of(free.states.rotation[-1]).item()
    other = YawObjective(_BEHIND, 0.4, may_be=lambda end: so3.yaw_of(end.rotation).item() * side < 0)
    found = choose_headings(other, profile, motion, (start, goal, goal), _ROBOT)
    assert found is not None and so3.yaw_of(found.states.rotation[-1]).item() * side < 0
    nowhere = YawObjective(_BEHIND, 0.4, may_be=lambda _: False)
    assert choose_headings(nowhere, profile, motion, (start, goal, goal), _ROBOT) is None


def test_a_search_that_keeps_headings_moves_positions_alone() -> None:
    motion, (start, goal) = planned(0.0)
    pushed = replace(start, position=start.position + torch.tensor([0.05, 0.0, 0.02]))
    for keeps in (False, True):
        problem = PlanProblem(_BEHIND, _ROBOT, pushed, goal, 16, keeps_headings=keeps)
        wavy = replace(motion, states=replace(motion.states, rotation=_waved(motion.states.rotation)))
        begun = shift_warm_start(wavy, pushed, goal, _ROBOT, executed=0, steps=16)
        found = run_steps(replan_fast(problem, begun, FastPlanConfig()))
        headings = _ROBOT.free_headings(len(begun.free))
        turned_by = (found.trajectory.free - begun.free)[headings].abs().max().item()
        moved_by = (found.trajectory.free - begun.free)[: headings.start].abs().max().item()
        assert (turned_by < 1e-4) == keeps and moved_by > 1e-3


def _waved(rotation: Tensor) -> Tensor:
    """Headings that swing to 0.4 rad and back."""
    swing = 0.4 * torch.sin(torch.linspace(0, math.pi, len(rotation)))
    return so3.from_yaw(swing) @ rotation


@pytest.mark.parametrize(("dt", "count"), [(0.02, 60), (0.1, 16)])
def test_a_robot_turns_no_faster_where_steps_are_short(dt: float, count: int) -> None:
    start = RigidState.at_rest((0.0, 0.0, 0.0))
    still = torch.tensor([_ROBOT.weight, 0.0, 0.0, 0.0]).expand(count, 4)
    way = Motion(RigidState.stack([start] * (count + 1)), still, dt)
    objective = YawObjective(_BEHIND, 0.4)
    found = choose_headings(objective, objective.profile_along(way.states), way, (start, start, start), _ROBOT)
    assert found is not None
    turned_by = np.diff(np.unwrap(so3.yaw_of(found.states.rotation).double().numpy()))
    assert np.abs(turned_by).max() <= 4.0 * dt + 1e-3


def test_how_fast_a_robot_turns_follows_from_what_it_can() -> None:
    assert limit_yaw_rate(_ROBOT, 4.0) == 4.0 and limit_yaw_rate(_ROBOT, 60.0) == 0.5 * _ROBOT.config.max_rate
    slow = Quadrotor(replace(_ROBOT.config, max_rate=2.0))
    assert limit_yaw_rate(slow, 4.0) == 1.0
    assert limit_yaw_rate(Couch(), 4.0) == 2.5

"""What a camera sees by its heading, and robots that turn to see something."""

import math

import numpy as np
import pytest
import torch

from nerfnav.field.voxel import VoxelField
from nerfnav.geometry import so3
from nerfnav.geometry.camera import FORWARD_MOUNT, Pose
from nerfnav.planner.sight import _mean_variance, seen_from, turned_to_see
from nerfnav.robots import RigidState
from tests.planner.test_first_ends import field_of

_PLACE = ((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0))
_BEHIND: VoxelField = field_of(_PLACE, ((-1.0, -1.0, -1.0), (-0.6, 1.0, 1.0)), spacing=0.05)
"""A wall in the west alone."""


def arriving(start: float, goal: float, enough: float = 0.4, field: VoxelField = _BEHIND) -> float:
    """Heading of the end of a way from south to north through the middle, for headings at its ends."""
    way = torch.tensor([[0.0, -0.8, 0.0], [0.0, 0.8, 0.0]])
    ends = tuple(RigidState.at_rest(tuple(point.tolist()), yaw) for point, yaw in zip(way, (start, goal), strict=True))
    path = way[0] + torch.linspace(0, 1, 21)[:, None] * (way[1] - way[0])
    turned = turned_to_see(field, path, ends, enough)
    assert torch.equal(turned.position, ends[1].position)
    return so3.yaw_of(turned.rotation).item()


def test_more_is_seen_towards_a_wall_than_away_from_it_whichever_way_the_camera_is_mounted() -> None:
    here, yaws = torch.zeros(1, 3), torch.tensor([0.0, math.pi / 2, math.pi])
    ahead = seen_from(_BEHIND, here, yaws)[0]
    assert ahead[0] < 0.01 < 0.1 < ahead[1] < 0.9 < ahead[2]
    astern = Pose(so3.from_yaw(torch.tensor(math.pi)) @ FORWARD_MOUNT.rotation, torch.zeros(3))
    assert seen_from(_BEHIND, here, yaws, astern)[0].tolist() == pytest.approx(ahead[[2, 1, 0]].tolist(), abs=0.05)


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


def test_of_the_headings_in_which_something_is_seen_it_takes_one_with_which_it_may_be_there() -> None:
    way = torch.tensor([[0.0, -0.8, 0.0], [0.0, 0.8, 0.0]])
    ends = RigidState.at_rest((0.0, -0.8, 0.0), 0.0), RigidState.at_rest((0.0, 0.8, 0.0), 0.0)
    free = so3.yaw_of(turned_to_see(_BEHIND, way, ends, 0.4).rotation).item()
    north = turned_to_see(_BEHIND, way, ends, 0.4, may_be=lambda end: so3.yaw_of(end.rotation).item() * free < 0)
    assert abs(free) > 2 and so3.yaw_of(north.rotation).item() * free < 0
    nowhere = turned_to_see(_BEHIND, way, ends, 0.4, may_be=lambda _: False)
    assert torch.equal(nowhere.rotation, ends[1].rotation)


def test_nothing_to_be_seen_changes_nothing() -> None:
    assert arriving(0.5, 0.7, field=field_of(_PLACE, spacing=0.1)) == pytest.approx(0.7, abs=1e-5)


def test_to_see_nothing_for_long_is_worse_than_to_see_nothing_now_and_then() -> None:
    blind_at_once, by_turns = (
        _mean_variance(np.array(shown, dtype=float)[:, None])[0] for shown in ([1, 1, 1, 0, 0, 0], [0, 1, 0, 1, 0, 1])
    )
    assert blind_at_once == pytest.approx(1.0) and by_turns == pytest.approx(0.5)

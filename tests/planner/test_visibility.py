"""What a camera sees by its heading, and by how much a robot has to turn to see something."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from nerfnav.field.models.voxel import VoxelField
from nerfnav.geometry import so3
from nerfnav.geometry.camera import FORWARD_MOUNT, Pose
from nerfnav.planner.visibility import VIEW_HEADINGS, VisibilityProfile, find_best_turn, measure_visibility
from nerfnav.robots import RigidState
from tests.planner.objective.test_default_ends import field_of

_PLACE = ((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0))
_BEHIND: VoxelField = field_of(_PLACE, ((-1.0, -1.0, -1.0), (-0.6, 1.0, 1.0)), spacing=0.05)
"""A wall in the west alone."""


def test_more_is_seen_towards_a_wall_than_away_from_it_whichever_way_the_camera_is_mounted() -> None:
    here, yaws = torch.zeros(1, 3), torch.tensor([0.0, math.pi / 2, math.pi])
    ahead = measure_visibility(_BEHIND, here, yaws)[0]
    assert ahead[0] < 0.01 < 0.1 < ahead[1] < 0.7 < ahead[2]
    astern = Pose(so3.from_yaw(torch.tensor(math.pi)) @ FORWARD_MOUNT.rotation, torch.zeros(3))
    assert measure_visibility(_BEHIND, here, yaws, astern)[0].tolist() == pytest.approx(
        ahead[[2, 1, 0]].tolist(), abs=0.05
    )


def test_a_blank_wall_shows_as_little_as_the_void() -> None:
    color = torch.full_like(_BEHIND.values[..., 1:], 0.3)
    blank = replace(_BEHIND, values=torch.cat([_BEHIND.values[..., :1], color], -1))
    before, painted = (
        measure_visibility(field, torch.zeros(1, 3), torch.tensor([math.pi]))[0, 0] for field in (blank, _BEHIND)
    )
    assert before < 0.1 < 0.7 < painted


def test_the_profile_is_that_of_the_places_and_headings_they_were_taken_at_and_between_them_between_those() -> None:
    seen = np.random.default_rng(0).random((3, VIEW_HEADINGS))
    profile, headings = VisibilityProfile(seen), np.arange(VIEW_HEADINGS) * math.tau / VIEW_HEADINGS
    for row, place in enumerate((0.0, 0.5, 1.0)):
        for turns in (-math.tau, 0.0, 2 * math.tau):
            found = profile.at(np.full(VIEW_HEADINGS, place), headings + turns)
            np.testing.assert_allclose(found, seen[row], atol=1e-9)
    between = profile.at(np.array([0.25]), np.array([-0.5 * math.tau / VIEW_HEADINGS]))
    assert between[0] == pytest.approx(seen[:2][:, [0, -1]].mean())


@pytest.mark.parametrize(("yaw", "share", "turn"), [(math.pi, 1.0, 0.0), (1.0, 0.1, 1.0), (-1.0, 0.1, -1.0)])
def test_a_robot_turns_the_shorter_way_and_no_farther_than_it_has_to(yaw: float, share: float, turn: float) -> None:
    now, left = find_best_turn(_BEHIND, RigidState.at_rest((0.0, 0.0, 0.0), yaw), 0.4)
    assert now >= 0.99 * share if share == 1 else now < 0.5
    assert left * turn > 0 or left == turn == 0
    assert abs(left) < math.pi - abs(yaw) + 1e-3, "the wall is wide: it is seen before it is straight ahead"
    there = measure_visibility(_BEHIND, torch.zeros(1, 3), torch.tensor([yaw + left]))[0, 0]
    assert there >= 0.4


def test_where_there_is_nothing_to_be_seen_nothing_says_where_to_turn() -> None:
    empty = field_of(_PLACE, spacing=0.1)
    assert find_best_turn(empty, RigidState.at_rest((0.0, 0.0, 0.0), 0.3), 0.4) == (pytest.approx(0.0, abs=1e-3), 0.0)

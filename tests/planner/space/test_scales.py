"""Lengths that follow from the place and the robot."""

import pytest

import nerfnav_scenes as scenes
from nerfnav import robots
from nerfnav.field.storage.checkpoint import load_field
from nerfnav.planner.space.occupancy import OccupancyConfig
from nerfnav.planner.space.scales import scales_of
from nerfnav.robots.body import Body
from tests.planner.halls import field_of, house
from tests.planner.places import ROBOT, ball


@pytest.mark.parametrize("name", ["stonehenge", "playground", "church"])
def test_in_the_bundled_worlds_they_are_what_was_chosen_for_the_papers_robot(name: str):
    scales = scales_of(load_field(scenes.trained_path(name)), ROBOT.body)
    assert scales.voxel == pytest.approx(0.04)
    assert scales.threshold == 5.0
    found = (scales.clearance, scales.snap, scales.search, scales.rounding, scales.berth, scales.reach, scales.drift)
    assert found == pytest.approx((0.1, 0.3, 1.0, 0.06, 0.16, 0.5, 0.05))
    assert scales.decimals == 2


def test_a_couch_has_eight_headings_and_a_sofa_as_many_as_its_length_asks_for():
    couch, sofa = (scales_of(ball(), robots.load(name).body) for name in ("couch", "sofa"))
    assert couch.headings == 8 and couch.turn == pytest.approx(0.15)
    ends_move = 0.5 * sofa.length * 3.1416 / sofa.headings
    assert ends_move <= 1.5 * sofa.voxel + 1e-3


@pytest.mark.parametrize("factor", [0.02, 1.0, 10.0])
def test_they_grow_with_place_and_robot(factor: float):
    body = Body.box((0.5 * factor, 0.5 * factor, 0.16 * factor), (3, 3, 2))
    scales = scales_of(field_of(house().scaled(factor), 0.1 * factor), body)
    assert scales.voxel == pytest.approx(0.2 * factor, rel=0.05)
    assert scales.reach == pytest.approx(2.5 * factor)
    assert scales.threshold == pytest.approx(min(5.0, 0.6 / (0.5 * factor), 5 * 0.0171 / (0.1 * factor)), rel=0.05)


def test_a_map_is_no_finer_than_the_field_nor_than_memory_and_patience_allow():
    coarse = field_of(house(), 0.2)
    assert scales_of(coarse, ROBOT.body).voxel >= coarse.resolution
    huge = field_of(house().scaled(1000.0), 500.0)
    assert huge.box.size.double().prod().item() / scales_of(huge, ROBOT.body).voxel ** 3 < 3e7


def test_what_is_set_by_hand_is_taken():
    scales = OccupancyConfig(voxel=0.123, threshold=7.0).scales(ball(), ROBOT.body)
    assert (scales.voxel, scales.threshold) == (0.123, 7.0)

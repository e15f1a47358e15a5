"""Clearance of bodies of any shape: that of the true solid."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from nerfnav.field.core.occupancy import SOLID_DENSITY
from nerfnav.planner.objective.clearance import SafetyConfig, measure_clearance
from nerfnav.robots import Motion, RigidState, interpolate_poses, load
from nerfnav.robots.body import Body
from tests.planner.places import ball, straight_motion
from tests.robots.thin import FIVE, SHAPES, Obstacles, dense_surface, random_poses, standing, thin_body, true_clearance

PLACE = Obstacles()
CONFIG = SafetyConfig(threshold=SOLID_DENSITY, reach=1.0)
BAR = 0.002
"""Largest error of a clearance [m]."""


@pytest.mark.slow
@pytest.mark.parametrize("shape", SHAPES)
def test_the_clearance_of_a_thin_body_is_that_of_its_solid(shape: str):
    body = thin_body(shape)
    surface, poses = dense_surface(body), random_poses(6, seed=3)
    for index in range(6):
        true = true_clearance(PLACE, body, surface, poses[index])
        assert measure_clearance(PLACE.field, standing(poses[index]), body, CONFIG) == pytest.approx(true, abs=BAR)


@pytest.mark.slow
def test_the_clearance_of_a_motion_is_the_least_at_and_between_its_waypoints():
    """One step past a ball, with a turn: both ends are farther from it than what lies between."""
    body, (x, y, z, radius) = thin_body("cross"), PLACE.ball
    first = replace(random_poses(1, seed=5)[0], position=torch.tensor([x - 0.2, y + radius + 0.6 * body.radius, z]))
    last = first.retract(torch.tensor([0.4, 0, 0, 0, 0, 0, 0.3, 0.4, 0.3, 0, 0, 0]))
    between, _ = interpolate_poses(RigidState.stack([first, last]), 0.01, 0.03)
    each = [
        measure_clearance(PLACE.field, standing(between[k]), body, CONFIG) or 0.0 for k in range(len(between.position))
    ]
    step = Motion(RigidState.stack([first, last]), torch.zeros(1, 4), 0.1)
    assert min(each) < min(each[0], each[-1]) - 0.005
    assert measure_clearance(PLACE.field, step, body, CONFIG) == pytest.approx(min(each), abs=BAR)


def test_a_ball_between_whose_points_a_stone_reaches_has_no_clearance():
    """The centre of one of five balls of 3 cm is 2.6 cm nearer to the stone than the two touch."""
    outer = FIVE[1][0]
    at = RigidState.at_rest((PLACE.ball[0] + PLACE.ball[3] + 0.004 - outer, PLACE.ball[1], PLACE.ball[2]))
    assert measure_clearance(PLACE.field, standing(at), thin_body("spheres"), CONFIG) == 0.0


def test_a_box_is_as_near_to_a_stone_as_its_face_and_not_only_its_points():
    """Eight points at the corners of a cube of 20 cm, the middle of whose face is 3 cm from the stone."""
    body = Body.box((0.2, 0.2, 0.2), (2, 2, 2))
    at = RigidState.at_rest((PLACE.ball[0] - PLACE.ball[3] - 0.13, PLACE.ball[1], PLACE.ball[2]))
    assert measure_clearance(PLACE.field, standing(at), body, CONFIG) == pytest.approx(0.03, abs=BAR)


def test_a_plate_that_lies_flat_along_a_face_has_that_distance():
    body = Body.box((0.01, 0.2, 0.4), (2, 3, 5))
    at = RigidState.at_rest((PLACE.upper[0] + 0.005 + 0.012, -0.05, 0.0))
    assert measure_clearance(PLACE.field, standing(at), body, CONFIG) == pytest.approx(0.012, abs=BAR)


@pytest.mark.parametrize("voxel", [0.01, 0.02])
def test_a_field_that_is_no_grid_is_measured_as_exactly(voxel: float):
    away = torch.linspace(0.2, 0.4, 2001)
    density = ball().density(torch.stack([torch.zeros(2001), away, torch.full((2001,), 0.4)], -1))
    radius = away[density > SOLID_DENSITY].max().item()
    body = load("quadrotor").body
    motion = straight_motion((-0.3, 0.4, 0.4), (0.3, 0.4, 0.4), 10)
    found = measure_clearance(ball(), motion, body, SafetyConfig(threshold=SOLID_DENSITY, reach=0.3, voxel=voxel))
    assert found == pytest.approx(0.35 - radius, abs=BAR)


def test_a_body_is_as_near_to_the_border_as_its_balls_and_corners():
    spheres, plate = (
        measure_clearance(PLACE.field, standing(RigidState.at_rest((0.0, 0.59, 0.6))), thin_body(shape), CONFIG)
        for shape in ("spheres", "plate")
    )
    assert spheres == pytest.approx(0.8 - 0.59 - 0.19, abs=1e-5) and plate == pytest.approx(0.01, abs=1e-5)


def test_what_is_beyond_the_reach_is_not_told():
    at = standing(RigidState.at_rest((-0.3, -0.5, 0.4)))
    reach = measure_clearance(PLACE.field, at, thin_body("spheres"), CONFIG)
    assert reach is not None and np.isfinite(reach)
    nearer = SafetyConfig(threshold=SOLID_DENSITY, reach=reach - 0.01)
    assert measure_clearance(PLACE.field, at, thin_body("spheres"), nearer) is None

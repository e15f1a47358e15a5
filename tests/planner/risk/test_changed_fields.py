"""Maps of a field that differs from another one in a box alone are as if they were made anew."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from nerfnav.field import UnknownSpace, origin_of, planning_field
from nerfnav.geometry import Box
from nerfnav.obstacles import BoxShape, Obstacle, ObstacleSet, Sphere, place_in_field, replace_in_field
from nerfnav.planner.risk.collision_map import CollisionMap, cached_c_space
from nerfnav.planner.risk.configuration_space import CSpace
from nerfnav.planner.risk.tracking_error import RiskContext
from nerfnav.robots import load
from tests.app.doubles import balls_place

BALL = Obstacle("ball", Sphere(0.1), (-0.6, 0.5, 0.4))


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["quadrotor", "couch"])
@pytest.mark.parametrize("place", [(0.1, 0.6, 0.4), (0.95, 0.9, 0.75)])
def test_what_is_derived_of_a_changed_field_is_as_if_made_anew(
    robot: str, place: tuple[float, float, float]
) -> None:
    bare, body = balls_place().field, load(robot)
    first = ObstacleSet((BALL, Obstacle("box", BoxShape((0.2, 0.3, 0.2)), (0.0, 0.6, 0.4))))
    then = ObstacleSet((BALL, Obstacle("box", BoxShape((0.2, 0.3, 0.2)), place, (0.0, 0.2, 0.4))))
    last = place_in_field(bare, first)
    changed = replace_in_field(bare, then, last, first)  # type: ignore[arg-type]
    whole = replace(place_in_field(bare, then))
    before, seen, anew = (planning_field(each, UnknownSpace.OCCUPIED) for each in (last, changed, whole))
    assert origin_of(seen) is not None and origin_of(anew) is None and origin_of(before) is not seen
    torch.testing.assert_close(seen.values, anew.values)  # type: ignore[attr-defined]
    assert np.array_equal(cached_c_space(seen, body, None).by_heading, CSpace.of(anew, body.body).by_heading)
    known, made = (CollisionMap.of(each, body, RiskContext()).chances for each in (seen, anew))
    np.testing.assert_allclose(known, made, atol=1e-6)


def test_a_copy_with_other_values_is_no_changed_field() -> None:
    bare, box = balls_place().field, ObstacleSet((Obstacle("box", BoxShape((0.2, 0.3, 0.2)), (0.0, 0.6, 0.4)),))
    placed = replace_in_field(bare, box, bare, ObstacleSet(()))  # type: ignore[arg-type]
    assert origin_of(placed) is not None
    filled = placed.values.clone()
    filled[:, :, 0, 0] = 10.0
    floored = replace(placed, values=filled)  # as holes of a floor are closed
    robot = load("quadrotor")
    cached_c_space(placed, robot, None)
    assert origin_of(floored) is None
    assert np.array_equal(cached_c_space(floored, robot, None).by_heading, CSpace.of(floored, robot.body).by_heading)


def test_the_window_of_a_box_has_the_nodes_in_it() -> None:
    first, spacing = np.zeros(3), np.full(3, 0.5)
    window = Box.of((0.4, -1.0, 0.5), (1.0, 0.1, 9.0)).window(first, spacing, (5, 5, 5))
    assert window == (slice(1, 3), slice(0, 1), slice(1, 5))
    assert Box.of((9, 9, 9), (10, 10, 10)).window(first, spacing, (5, 5, 5))[0] == slice(5, 5)

import pytest
import torch

import nerfnav_scenes as scenes
from nerfnav import robots
from nerfnav.robots.state import RigidState
from nerfnav.world.collision import ground
from nerfnav.world.contact import judge
from nerfnav.world.scene import Scene

_BODY = robots.load("quadrotor").body


@pytest.fixture(scope="module")
def playground() -> Scene:
    return scenes.load("playground")


def _straight(*points: tuple[float, float, float]) -> RigidState:
    return RigidState.stack([RigidState.at_rest(point) for point in points])


def test_a_quadrotor_fits_through_the_tube_the_hoop_the_ladder_bars_and_a_cell_of_the_jungle_gym(playground: Scene):
    for way in [
        ((-0.5, 0.55, 0.57), (0.36, 0.55, 0.57)),
        ((0.083, -0.832, 0.36), (-0.123, -0.268, 0.36)),
        ((-0.5, -0.6, 0.51), (-0.5, 0.2, 0.51)),
        ((0.57, -1.15, 0.13), (0.57, -0.3, 0.13)),
    ]:
        assert judge(playground, _BODY, _straight(*way)).first_touched_step is None, way


def test_bars_are_thick_enough_for_voxels(playground: Scene):
    for solid in playground.solids:
        assert solid.bounding_box_oriented.primitive.extents.min() > 0.038


def test_decks_and_the_roof_stop_who_comes_from_above(playground: Scene):
    for x, y, high, low in [(-0.5, 0.55, 1.1, 0.6), (0.36, 0.55, 0.8, 0.3), (0.36, 0.1, 0.6, 0.15)]:
        assert judge(playground, _BODY, _straight((x, y, high), (x, y, low))).first_touched_step == 0


def test_tasks_are_ten_flights_some_of_them_blocked_and_most_of_them_up_or_down(playground: Scene):
    assert len(playground.tasks) == 10
    assert {task.robot for task in playground.tasks} == {"quadrotor"}
    rises = torch.tensor([abs(task.goal[2] - task.start[2]) for task in playground.tasks])
    assert (rises > 0.05).sum() >= 7
    straight = [RigidState.stack([task.start_state, task.goal_state]) for task in playground.tasks]
    assert sum(bool(ground(playground).touches(_BODY, way).any()) for way in straight) == 0

import math

import numpy as np
import pytest

import nerfnav_scenes as scenes
from nerfnav import robots
from nerfnav.robots.state import RigidState
from nerfnav.world.contact import contact_check
from nerfnav.world.raycast import RayCaster
from nerfnav.world.scene import Scene

_COUCH = robots.load("couch").body
_ACROSS = math.pi / 2


@pytest.fixture(scope="module")
def church() -> Scene:
    return scenes.load("church")


def _pushed(scene: Scene, start: tuple[float, float], goal: tuple[float, float], yaw: float) -> bool:
    """Whether a couch touches anything on a straight way without turning."""
    return contact_check(scene, _COUCH)(*(RigidState.at_rest((*point, 0.07), yaw) for point in (start, goal)))


def test_a_couch_fits_through_the_rood_screen_only_lengthwise(church: Scene):
    assert not _pushed(church, (0.2, 0.0), (0.85, 0.0), 0.0)
    assert _pushed(church, (0.2, 0.0), (0.85, 0.0), _ACROSS)


def test_a_couch_fits_between_the_pews_only_crosswise(church: Scene):
    assert not _pushed(church, (-0.746, 0.26), (-0.746, -0.26), _ACROSS)
    assert _pushed(church, (-0.746, 0.26), (-0.746, -0.26), 0.0)


def test_the_doorway_of_the_screen_is_the_only_way_on_the_ground_into_the_chancel(church: Scene):
    """Level rays from the nave, 7 cm above the floor, pass the screen inside 20 cm alone."""
    across = np.linspace(-0.75, 0.75, 301)
    eyes = np.stack([np.full_like(across, 0.5), across, np.full_like(across, 0.07)], -1).astype(np.float32)
    rays = np.tile(np.array([1, 0, 0], np.float32), (len(across), 1))
    passes = RayCaster(church.mesh).first_hits(eyes, rays).distance > 0.3
    assert np.abs(across[passes]).max() == pytest.approx(0.1, abs=0.01)
    assert passes[np.abs(across) < 0.09].all()


def test_robots_on_the_ground_stand_3_cm_above_a_flat_floor(church: Scene):
    inside = church.solids[0].vertices[:, 2]
    assert inside.max() == pytest.approx(0, abs=1e-9)
    for task in church.tasks:
        body = robots.load(task.robot)
        if body.planar:
            assert task.start[2] == task.goal[2] == pytest.approx(0.03 + body.body.extents[2] / 2)


def test_there_are_tasks_for_every_robot_of_the_paper(church: Scene):
    count = {robot: sum(task.robot == robot for task in church.tasks) for robot in ("quadrotor", "couch", "diffdrive")}
    assert count == {"quadrotor": 10, "couch": 5, "diffdrive": 5}


@pytest.mark.slow
def test_couches_must_turn_at_the_screen(church: Scene):
    for task in church.tasks:
        if task.robot == "couch":
            assert contact_check(church, _COUCH)(task.start_state, task.goal_state)

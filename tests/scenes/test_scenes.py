import math
from dataclasses import replace

import pytest
import torch

import nerfnav_scenes as scenes
from nerfnav import robots
from nerfnav.core.errors import UnknownNameError
from nerfnav.robots import StateNoise
from nerfnav.robots.body import Body
from nerfnav.robots.state import RigidState
from nerfnav.world.collision import ground
from nerfnav.world.contact import judge

_BODY = Body.box((0.1, 0.1, 0.04), (2, 2, 2))


def test_an_unknown_scene_is_refused_with_the_known_ones():
    with pytest.raises(UnknownNameError, match="apartment, blocks, church, playground, stonehenge"):
        scenes.load("atlantis")
    with pytest.raises(UnknownNameError, match="apartment, blocks, church, playground, stonehenge"):
        scenes.trained_path("atlantis")
    with pytest.raises(UnknownNameError, match="apartment, blocks, church, playground, stonehenge"):
        scenes.tasks_of("atlantis")


@pytest.mark.parametrize("name", scenes.names())
def test_the_tasks_of_a_scene_are_known_without_it(name: str):
    assert scenes.tasks_of(name) == scenes.load(name).tasks


@pytest.mark.parametrize("name", scenes.names())
def test_no_two_tasks_of_a_scene_have_the_same_name(name: str):
    """The page offers them in one list, which must not hold a name twice."""
    names = [task.name for task in scenes.tasks_of(name)]
    assert len(set(names)) == len(names)


def test_scenes_are_built_once_and_know_where_their_field_lies():
    assert scenes.names()[0] == "stonehenge"
    assert scenes.load("blocks") is scenes.load("blocks")
    assert scenes.trained_path("blocks").parts[-3:] == ("nerfnav_scenes", "trained", "blocks.npz")


@pytest.mark.parametrize("name", scenes.names())
def test_all_solids_are_watertight_and_inside_the_box(name: str):
    scene = scenes.load(name)
    for solid in scene.solids:
        assert solid.is_watertight
        assert solid.volume > 0
    assert scene.box.contains(torch.tensor(scene.mesh.bounds, dtype=torch.float32)).all()


@pytest.mark.parametrize("name", scenes.names())
def test_what_is_touched_is_what_is_seen(name: str):
    scene = scenes.load(name)
    assert sum(len(solid.faces) for solid in scene.solids) == len(scene.mesh.faces)


@pytest.mark.parametrize("name", scenes.names())
def test_the_ends_of_all_flights_are_free_with_room_to_spare(name: str):
    """A level cylinder that holds the body at any yaw and 4 cm more, 2 cm towards the ground."""
    scene = scenes.load(name)
    flights = [task for task in scene.tasks if not robots.load(task.robot).planar]
    assert flights
    yaws = torch.linspace(0, torch.pi / 2, 5)[:-1].tolist()
    for task in flights:
        long, wide, high = robots.load(task.robot).body.extents
        across = math.hypot(long, wide) + 0.08
        body = Body.box((across, across, high + 0.04), (2, 2, 2))
        states = [RigidState.at_rest(end, yaw) for end in (task.start, task.goal) for yaw in yaws]
        # the turned squares overlap in the cylinder: it is free where any of them is
        free = ~ground(scene).touches(body, RigidState.stack(states)).reshape(-1, len(yaws))
        assert free.any(-1).all(), task.name
        assert scene.box.contains(torch.stack([state.position for state in states])).all()


@pytest.mark.parametrize("name", scenes.names())
def test_the_ends_of_all_drives_are_free_1_8_cm_around_and_can_be_joined(name: str):
    scene = scenes.load(name)
    for task in scene.tasks:
        robot = robots.load(task.robot)
        robot.check_ends(task.start_state, task.goal_state)
        if robot.planar:
            states = RigidState.stack([task.start_state, task.goal_state])
            assert not ground(scene).touches(robot.body.grown(0.018), states).any(), task.name
            assert scene.box.contains(states.position).all()


@pytest.mark.parametrize("name", scenes.names())
def test_scenes_are_light_enough_for_a_laptop(name: str):
    assert len(scenes.load(name).mesh.faces) < 1_500_000


def test_the_first_task_of_blocks_is_blocked_and_the_second_is_not():
    scene = scenes.load("blocks")
    straight = [RigidState.stack([task.start_state, task.goal_state]) for task in scene.tasks]
    assert [judge(scene, _BODY, states).first_touched_step for states in straight] == [0, None]


@pytest.mark.parametrize("name", scenes.names())
def test_no_push_of_three_deviations_of_the_papers_noise_brings_a_quadrotor_into_anything_at_an_end(name: str):
    """What the first step's noise does no action can answer: where it touches, no flight is safe."""
    touches = ground(scenes.load(name)).touches
    away = 3 * StateNoise().position_m * torch.eye(3)
    flown = [task for task in scenes.tasks_of(name) if task.robot == "quadrotor"]
    for end in (state for task in flown for state in (task.start_state, task.goal_state)):
        pushed = [replace(end, position=end.position + push) for push in (*away, *-away)]
        assert not touches(robots.load("quadrotor").body, RigidState.stack(pushed)).any(), end.position

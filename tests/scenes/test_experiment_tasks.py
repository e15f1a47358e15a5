"""The twenty flights of the comparison of planners."""

import torch

import nerfnav_scenes as scenes
from nerfnav.robots.quadrotor import Quadrotor
from nerfnav.robots.state import RigidState
from nerfnav.world.collision import ground
from nerfnav_scenes.tasks.stonehenge import EXPERIMENT_TASKS


def test_there_are_twenty_with_names_of_their_own_and_the_authors_ten_first() -> None:
    assert len({task.name for task in EXPERIMENT_TASKS}) == len(EXPERIMENT_TASKS) == 20
    assert EXPERIMENT_TASKS[0].start == (0.55, -0.02, 0.05)
    assert EXPERIMENT_TASKS[2:10] == scenes.load("stonehenge").tasks[2:10]


def test_some_ask_for_a_change_of_height() -> None:
    assert sum(abs(task.goal[2] - task.start[2]) > 0.2 for task in EXPERIMENT_TASKS) >= 5


def test_all_begin_and_end_a_centimetre_clear_of_the_stones() -> None:
    body = Quadrotor().body.grown(0.01)
    ends = [state for task in EXPERIMENT_TASKS for state in (task.start_state, task.goal_state)]
    assert not torch.any(ground(scenes.load("stonehenge")).touches(body, RigidState.stack(ends)))

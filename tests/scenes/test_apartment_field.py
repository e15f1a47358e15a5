"""The apartment's own field: plain walls, which photographs alone cannot place, and what is planned among them."""

import pytest

import nerfnav
import nerfnav_scenes as scenes
from nerfnav import robots
from nerfnav.field import VoxelField, load_field
from nerfnav.planner.objective.problem import PlanProblem
from nerfnav.planner.steps import PlanOutcome
from nerfnav.world import Task, judge


@pytest.fixture(scope="module")
def field() -> VoxelField:
    field = load_field(scenes.trained_path("apartment"))
    assert isinstance(field, VoxelField)
    return field


def test_it_is_learned_from_pictures_and_its_walls_are_walls(field: VoxelField):
    info = field.info
    assert info.learned_from == "pictures"
    assert info.surface_taken_for_free is not None and info.surface_taken_for_free < 0.01
    assert info.free_taken_for_free is not None and info.free_taken_for_free > 0.9


_MINUTES = ("From the living room into the hall by the kitchen",)
"""Tasks whose plans take minutes: the sofa's hardest turn."""


def _marks(task: Task) -> tuple[pytest.MarkDecorator, ...]:
    return (pytest.mark.nightly,) if task.robot == "sofa" and task.name in _MINUTES else ()


@pytest.mark.slow
@pytest.mark.parametrize("task", [
    pytest.param(task, marks=_marks(task), id=f"{task.robot}: {task.name}") for task in scenes.tasks_of("apartment")
])  # fmt: skip
def test_each_task_is_planned_within_limits_and_touches_nothing(field: VoxelField, task: Task):
    robot = robots.load(task.robot)
    problem = PlanProblem(field, robot, task.start_state, task.goal_state)
    last = nerfnav.plan(problem, duration="auto")
    assert last.outcome is PlanOutcome.CONVERGED
    assert judge(scenes.load("apartment"), robot.body, last.motion.states).max_overlap_m3 == 0

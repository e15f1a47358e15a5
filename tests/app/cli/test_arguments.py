"""What a route asks of the planner, from the words of a command line."""

from dataclasses import replace

import pytest

import nerfnav_scenes as scenes
from nerfnav.planner import FastPlanConfig
from nerfnav.robots import load
from nerfnav_app.cli.arguments import Route
from nerfnav_app.places.place import Place, Truth
from tests.experiments.places import column


@pytest.fixture
def flat() -> Place:
    """The tasks of the apartment, for the robot that flies there."""
    truth = Truth(scenes.tasks_of("apartment"), lambda: column().scene)
    return Place("flat", column().field, truth, load("quadrotor25"))


def test_a_task_is_given_twenty_steps_only_where_so_many_can_be_enough(flat: Place) -> None:
    asked = [Route("flat", task=task).request(flat, FastPlanConfig()) for task in (1, 9)]
    assert [(request.steps, request.shortest) for request in asked] == [(20, False), (20, True)]
    far = Route("flat", task=9)
    assert not replace(far, steps=20).request(flat, FastPlanConfig()).shortest, "who says a number of steps has it"
    assert not replace(far, dt=0.4).request(flat, FastPlanConfig()).shortest, "8.4 m in 8 s"
    slower = replace(flat, robot=load("crazyflie"))
    assert Route("flat", task=0).request(slower, FastPlanConfig()).shortest
    assert not Route("flat", task=1).request(slower, FastPlanConfig()).shortest

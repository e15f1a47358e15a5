"""Gusts of the page, scaled to the clearance of the moment."""

from dataclasses import replace

import pytest
import torch

from nerfnav.field import UnknownSpace
from nerfnav.navigation import NavigationStep
from nerfnav.obstacles import BoxShape, ConstantVelocity, Obstacle, ObstacleSet, Sphere
from nerfnav.planner import FastPlanConfig, SafetyConfig, measure_clearance
from nerfnav.robots import Motion, RigidState
from nerfnav_app.cli.arguments import Route
from nerfnav_app.jobs.fly.fly import run
from nerfnav_app.jobs.fly.request import FlyRequest
from nerfnav_app.places.derived import prepare_place
from nerfnav_app.places.obstacles import place_obstacles
from nerfnav_app.places.place import Place, open_place
from nerfnav_app.state.flight import LARGEST_GUST
from nerfnav_app.state.job import Job, JobKind
from nerfnav_app.state.session import Session
from nerfnav_app.worker.operator_requests import SessionRequests, find_kidnap_pose, make_gust

HOVER = torch.tensor([2.4525, 0.0, 0.0, 0.0])


def clearance_at(place: Place, state: RigidState) -> float:
    planned = prepare_place(place, UnknownSpace.OCCUPIED)
    held = Motion(RigidState.stack([state, state]), torch.zeros(1, 1), 0.1)
    found = measure_clearance(planned.field, held, place.robot.body, SafetyConfig())
    assert found is not None
    return found


def test_a_gust_is_scaled_to_the_clearance_and_is_none_at_the_border(opened: Session) -> None:
    place = opened.place
    assert place is not None
    box, robot = place.field.box, place.robot
    speeds = []
    for above in (0.25, 0.1, 0.0):
        state = RigidState.at_rest((-0.7, 0.0, box.lower[2].item() + 0.5 * robot.body.extents[2] + above))
        gust = make_gust(place, state, HOVER, 0.1)
        assert gust.velocity_mps <= 0.2 * (2 * robot.deceleration * clearance_at(place, state)) ** 0.5 + 1e-6
        speeds.append(gust.velocity_mps)
    assert speeds[0] > speeds[1] > speeds[2] == 0.0


def test_a_gust_counts_the_clearance_at_the_end_of_the_step_as_well(opened: Session) -> None:
    place = opened.place
    assert place is not None
    low = place.field.box.lower[2].item() + 0.5 * place.robot.body.extents[2]
    hovering = RigidState.at_rest((-0.7, 0.0, low + 0.2))
    falling = replace(hovering, velocity=torch.tensor([0.0, 0.0, -1.9]))
    soon, now = (make_gust(place, state, HOVER, 0.1).velocity_mps for state in (falling, hovering))
    assert soon < 0.5 * now


def test_a_gust_does_not_push_a_robot_into_a_mover_and_a_kidnapped_one_is_not_put_there(opened: Session) -> None:
    place = opened.place
    assert place is not None
    state = RigidState.at_rest((-0.7, 0.0, 0.4))
    speeds = []
    for away, time in ((0.3, 0.0), (0.12, 0.0), (0.12, 10.0)):  # at 10 s it is elsewhere
        corner = (-0.7, away + 0.05, 0.4)
        mover = Obstacle("ball", Sphere(0.05), corner, motion=ConstantVelocity((0.0, 0.2, 0.0)))
        among = place_obstacles(place, ObstacleSet((mover,)))
        speeds.append(make_gust(among, state, HOVER, 0.1, time).velocity_mps)
    assert speeds[1] < speeds[0] and speeds[1] < speeds[2] == make_gust(place, state, HOVER, 0.1).velocity_mps
    everywhere = Obstacle("fog", BoxShape((9.0, 9.0, 9.0)), (0.0, 0.0, 0.0), motion=ConstantVelocity((0.0, 0.0, 3.0)))
    filled = place_obstacles(place, ObstacleSet((everywhere,)))
    assert find_kidnap_pose(filled, state, torch.Generator().manual_seed(0)) is None
    assert find_kidnap_pose(filled, state, torch.Generator().manual_seed(0), time=30.0) is not None


def test_what_a_robot_on_the_ground_stands_on_does_not_weaken_its_gust(opened: Session) -> None:
    assert opened.place is not None
    place = opened.place.with_robot("couch")
    low = place.field.box.lower[2].item() + 0.5 * place.robot.body.extents[2]
    state = RigidState.at_rest((-0.6, 0.0, low + 0.005))
    gust = make_gust(place, state, torch.zeros(3), 0.1)
    assert clearance_at(place, state) < 0.01 and gust.velocity_mps > 0.5 * LARGEST_GUST.velocity_mps


@pytest.mark.slow
@pytest.mark.parametrize("press", [4, 10])
def test_a_robot_that_is_pushed_in_flight_stays_in_the_place(press: int) -> None:
    place = open_place("stonehenge")
    route = Route("stonehenge").request(place, FastPlanConfig())
    job = Job(1, JobKind.FLY, route.ends)
    helm, steps = SessionRequests(job, place), list[NavigationStep]()
    for event in helm.watch(run(FlyRequest(route, seed=press, operator=helm.take), place)):
        if isinstance(event, NavigationStep):
            steps.append(event)
            if event.index == press:
                helm._job = replace(job, gusts=1)
    assert [step.index for step in steps if step.gust_mps] == [press + 1]
    assert 0 < (steps[press + 1].gust_mps or 0.0) <= LARGEST_GUST.velocity_mps
    assert all(place.field.box.contains(step.truth.position) for step in steps)
    assert steps[-1].outcome is not None

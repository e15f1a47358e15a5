"""Guidance: a plan that is safe, or what is safe in place of one."""

import re
from dataclasses import replace

import pytest
import torch

from nerfnav.estimator import Belief
from nerfnav.field import Field
from nerfnav.geometry import Camera
from nerfnav.live.answer import Goal, Guidance, Order
from nerfnav.live.guide import Guide, GuideConfig
from nerfnav.live.navigator import Navigator
from nerfnav.planner import fits
from nerfnav.robots import DiffDrive, NoiseModel, Quadrotor, RigidState, StateNoise
from tests.estimator.places import voxel_balls
from tests.planner.halls import Block, Building, field_of, shell_of

SIZE = (3.0, 2.0, 1.4)
WALL = Block((1.4, 0.0, 0.0), (1.5, 1.3, 1.4))
"""Across the room, but for a door of 70 cm."""
CLOSED = Block((1.4, 0.0, 0.0), (1.5, 2.0, 1.4))
GOAL = Goal((2.5, 0.5, 0.7), 0.3)
ROBOT = Quadrotor()


def room(*blocks: Block) -> Field:
    return field_of(Building(SIZE, (*shell_of(SIZE, 0.05), *blocks)), 0.025)


def belief(x: float, y: float, z: float = 0.7, std: float = 0.003, velocity: tuple[float, ...] = (0, 0, 0)) -> Belief:
    state = RigidState.at_rest((x, y, z))
    return Belief(replace(state, velocity=torch.tensor(velocity).float()), StateNoise.isotropic(std**2).covariance())


@pytest.fixture(scope="module")
def guide() -> Guide:
    return Guide(room(WALL), ROBOT)


def assert_is_clear(field: Field, guidance: Guidance) -> None:
    """The body fits wherever the curve leads."""
    start, end = guidance.setpoints[0].time, guidance.setpoints[-1].time
    for share in torch.linspace(0, 1, 200).tolist():
        point = guidance.at(start + share * (end - start))
        assert point is not None and fits(field, ROBOT.body, RigidState.at_rest(point.position, point.yaw))


def test_the_way_to_the_goal_leads_through_the_door(guide: Guide) -> None:
    guide.forget()
    told = guide.toward(GOAL, belief(0.5, 0.5), 10.0)
    assert told.order is Order.FOLLOW and told.collision_bound is not None and told.collision_bound < 0.1
    assert told.setpoints[0].time == 10.0 and told.setpoints[-1].position == pytest.approx(GOAL.position, abs=1e-5)
    assert max(point.position[1] for point in told.setpoints) > 1.3
    assert_is_clear(guide.field, told)


def test_plans_allow_for_what_pictures_leave_unknown_in_the_place() -> None:
    balls, errors = voxel_balls(), []
    for noise_std in (0.02, 0.5):
        field = replace(balls, info=replace(balls.info, noise_std=noise_std))
        _, safety_filter = Guide(field, ROBOT)._pilot(0.4)
        assert safety_filter is not None
        errors.append(safety_filter.noise.estimate.position_m)
    assert errors[0] == NoiseModel().estimate.position_m and errors[1] > 2 * errors[0]


def test_plans_allow_for_what_the_given_camera_leaves_unknown() -> None:
    errors = []
    for camera in (None, Camera.from_fov(8, 6, 60.0)):
        _, safety_filter = Navigator(voxel_balls(), ROBOT, camera)._guide._pilot(0.4)
        assert safety_filter is not None
        errors.append(safety_filter.noise.estimate.position_m)
    assert errors[1] > 1.5 * errors[0], errors


@pytest.mark.slow
@pytest.mark.parametrize("period", [0.04, 0.1])
def test_plans_are_redone_from_beliefs_and_arrive(guide: Guide, period: float) -> None:
    guide.forget()
    generator, time, state, orders = torch.Generator().manual_seed(0), 10.0, belief(0.5, 0.5), []
    while time < 16 and Order.ARRIVED not in orders:
        told = guide.toward(GOAL, state, time)
        orders.append(told.order)
        assert told.order in (Order.FOLLOW, Order.ARRIVED), told.reason
        time += period
        point = told.at(time)
        assert point is not None
        x, y, z = (torch.tensor(point.position) + 0.004 * torch.randn(3, generator=generator)).tolist()
        state = belief(x, y, z, velocity=point.velocity)
        if told.order is Order.FOLLOW and told.setpoints[0].time > time - 1.5 * period:
            assert_is_clear(guide.field, told)
    assert orders[-1] is Order.ARRIVED, time
    assert told.setpoints[0].position == GOAL.position


def test_a_plan_is_kept_for_a_step_unless_the_vehicle_has_strayed(guide: Guide) -> None:
    guide.forget()
    told = guide.toward(GOAL, belief(0.5, 0.5), 10.0)
    assert guide.toward(GOAL, belief(0.51, 0.5), 10.05) is told
    assert guide.toward(GOAL, belief(0.6, 0.5), 10.06) is not told


def test_without_a_way_the_vehicle_stays_where_it_is() -> None:
    guide = Guide(room(CLOSED), ROBOT)
    told = guide.toward(GOAL, belief(0.5, 0.5), 1.0)
    assert told.order is Order.BRAKE and "no safe plan is known: no free way leads" in told.reason
    assert max(point.position[0] for point in told.setpoints) < 0.55
    assert told.setpoints[-1].velocity == pytest.approx((0, 0, 0), abs=1e-6)


def test_a_vehicle_that_moves_brakes_in_free_space_when_its_way_is_gone() -> None:
    guide = Guide(room(CLOSED), ROBOT)
    told = guide.toward(GOAL, belief(0.5, 0.7, velocity=(1.0, 0.0, 0.0)), 1.0)
    assert told.order is Order.BRAKE
    assert_is_clear(guide.field, told)
    assert told.setpoints[0].velocity[0] == pytest.approx(1.0, abs=0.05)


def test_one_that_cannot_stop_any_more_is_told_to_hold_by_its_own_means() -> None:
    guide = Guide(room(CLOSED), ROBOT)
    told = guide.toward(GOAL, belief(1.25, 0.7, velocity=(3.0, 0.0, 0.0)), 1.0)
    assert told.order is Order.HOLD and not told.setpoints and told.at(2.0) is None


@pytest.mark.parametrize(
    ("goal", "start", "reason"),
    [
        (Goal((1.45, 0.5, 0.7)), belief(0.5, 0.5), "the goal .* is in occupied space"),
        (Goal((9.0, 0.5, 0.7)), belief(0.5, 0.5), "the goal .* is outside the field"),
        (Goal((float("nan"), 0.5, 0.7)), belief(0.5, 0.5), "finite numbers"),
        (GOAL, belief(0.5, 0.5, std=0.1), "known to 10.0 cm, and plans need 2.5 cm"),
        (GOAL, belief(1.35, 0.5), "the start .* is in occupied space"),
        (GOAL, belief(-4.0, 0.5), "the start .* is outside the field"),
    ],
)
def test_what_cannot_be_planned_is_held_with_a_reason(guide: Guide, goal: Goal, start: Belief, reason: str) -> None:
    told = guide.toward(goal, start, 1.0)
    assert told.order is Order.HOLD and not told.setpoints
    assert re.search(reason, told.reason), told.reason


def test_a_vehicle_beside_a_goal_that_is_in_a_wall_or_behind_one_has_not_arrived() -> None:
    thin = Block((1.4, 0.0, 0.0), (1.4, 2.0, 1.4))
    guide = Guide(room(thin), ROBOT, GuideConfig(arrived_m=0.4))
    assert guide.toward(Goal((1.4, 0.5, 0.7)), belief(1.2, 0.5), 1.0).order is Order.HOLD
    assert guide.toward(Goal((1.57, 0.5, 0.7)), belief(1.22, 0.5), 1.0).order is Order.BRAKE


def test_a_new_goal_gets_a_new_plan(guide: Guide) -> None:
    guide.forget()
    guide.toward(GOAL, belief(0.5, 0.5), 1.0)
    other = Goal((0.5, 1.5, 0.9))
    told = guide.toward(other, belief(0.52, 0.51), 1.1)
    assert told.order is Order.FOLLOW and told.setpoints[-1].position == pytest.approx(other.position, abs=1e-5)


@pytest.mark.slow
def test_a_robot_on_the_ground_is_guided_at_its_height() -> None:
    robot = DiffDrive()
    guide = Guide(room(), robot, GuideConfig(minimum_horizon=10))
    start = belief(0.5, 1.0, 0.205)
    told = guide.toward(Goal((2.2, 1.2, 0.2)), start, 1.0)
    assert told.order is Order.FOLLOW, told.reason
    assert {round(point.position[2], 6) for point in told.setpoints} == {0.2}

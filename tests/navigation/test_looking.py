"""Robots that see nothing and turn to where something is to be seen."""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.estimator import Belief
from nerfnav.field.models.voxel import VoxelField
from nerfnav.geometry import so3
from nerfnav.navigation.episode import EpisodeOutcome, NavigationStep
from nerfnav.navigation.fallback import FallbackConfig, SafetyFilter, come_to_rest
from nerfnav.navigation.flight import FlightContext, NavigateConfig, NavigationStack
from nerfnav.navigation.looking import command_yaw_rate, find_turn, give_way, hold, side_of
from nerfnav.navigation.loop import navigate
from nerfnav.navigation.supervisor import SupervisorAction, SupervisorConfig, SupervisorMemory
from nerfnav.obstacles import BoxShape, ConstantVelocity, Obstacle
from nerfnav.planner import Movers
from nerfnav.planner.active_yaw import wrap_yaw
from nerfnav.planner.visibility import find_best_turn
from nerfnav.robots import NoiseModel, RigidState, StateNoise, load
from tests.navigation.doubles import CALM, REQUEST, ROBOT, Oracle, StraightPlanner, draws, simulator
from tests.navigation.test_expected_belief import flight
from tests.planner.objective.test_default_ends import field_of
from tests.planner.places import Wall

CONFIG = NavigateConfig(initial=CALM, noise=CALM)
_PLACE = ((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0))


def test_a_robot_that_sees_nothing_turns_the_shorter_way_to_the_middle_of_the_place() -> None:
    middle = torch.tensor([1.0, 0.0, 0.5])
    for x, y, heading, side in [(0, 0, 0.5, -1.0), (0, 0, -0.5, 1.0), (2, 0, 3.0, 1.0), (2, 0, -3.0, -1.0)]:
        assert side_of(RigidState.at_rest((float(x), float(y), 0.5), heading), middle) == side


@pytest.mark.parametrize("aim", [0.3, -1.5, 3.0])
def test_a_robot_turns_to_a_heading_quickly_and_stays_there(aim: float) -> None:
    start = RigidState.at_rest((0.0, 0.0, 0.5))
    motion = come_to_rest(ROBOT, start, 20, 0.1, partial(command_yaw_rate, aim=aim, most=6.0, around=2.5, dt=0.1))
    yaws = so3.yaw_of(motion.states.rotation)
    assert motion.states.body_rate[:, 2].abs().max() < 6.01
    off = ((yaws - aim + math.pi) % math.tau - math.pi).abs()
    arrives = 3 + math.ceil(abs(aim) / 0.6)
    assert off[arrives:].max() < 0.1, "and does not swing past it"
    assert (motion.states.position - start.position).norm(dim=-1).max() < 0.01


def flown(place: VoxelField, in_sight: float = 0.4) -> list[NavigationStep]:
    """A flight of a robot that begins by looking to the east."""
    world = simulator()
    stack = NavigationStack(StraightPlanner(), Oracle(world), camera_field=place)
    config = NavigateConfig(initial=CALM, noise=CALM, in_sight=in_sight)
    return [step for step in navigate(REQUEST, world, stack, config, draws(1)) if isinstance(step, NavigationStep)]


def test_a_robot_that_should_see_nothing_from_where_it_stands_turns_before_it_leaves() -> None:
    behind = field_of(_PLACE, ((-1.0, -1.0, -1.0), (-0.8, 1.0, 1.0)), spacing=0.05)
    steps = flown(behind)
    assert steps[0].recovery is SupervisorAction.BLIND and steps[0].plan.states.velocity.norm(dim=-1).max() < 0.1
    assert (
        find_best_turn(behind, steps[0].plan.states[-1], 0.4)[0]
        > 0.5
        > find_best_turn(behind, steps[0].plan.states[0], 0.4)[0]
    )
    assert not steps[1].holds, "a picture has said where it is"
    assert steps[-1].outcome is EpisodeOutcome.REACHED


def test_a_robot_that_should_see_something_leaves_at_once_and_so_does_one_whose_headings_are_not_chosen() -> None:
    before, behind = ((0.8, -1.0, -1.0), (1.0, 1.0, 1.0)), ((-1.0, -1.0, -1.0), (-0.8, 1.0, 1.0))
    for steps in (flown(field_of(_PLACE, before, spacing=0.05)), flown(field_of(_PLACE, behind, spacing=0.05), 0.0)):
        assert all(step.recovery is None for step in steps) and steps[-1].outcome is EpisodeOutcome.REACHED


def test_a_robot_that_holds_turns_to_where_pictures_should_tell_it_most_and_not_to_where_they_did_not() -> None:
    away = RigidState.at_rest((-0.6, 0.0, 0.3), math.pi)
    turn = find_turn(away, (), flight())
    heading = wrap_yaw(math.pi + turn)
    assert abs(heading) < 1.0
    blind = Belief(RigidState.at_rest((-0.6, 0.0, 0.3), heading), StateNoise.isotropic(0.1**2).covariance())
    assert abs(find_turn(away, (blind,), flight()) - turn) > 0.1


def beside_wall(x: float, position_m: float = 0.03) -> tuple[Belief, FlightContext]:
    """A belief in a box with a wall at |x| < 0.1, and a flight with a safety filter there."""
    world = simulator()
    stack = NavigationStack(StraightPlanner(), Oracle(world), safety_filter=SafetyFilter(Wall(door=0.0), ROBOT))
    belief = Belief(RigidState.at_rest((x, 0.0, 0.5)), replace(CALM, position_m=position_m).covariance())
    return belief, FlightContext(REQUEST, world, stack, NavigateConfig(), draws(1))


@pytest.mark.parametrize("x", [-0.3, -0.18, 0.18, 0.3])
def test_a_robot_that_sees_too_little_gives_way_to_a_wall_beside_it(x: float) -> None:
    belief, context = beside_wall(x)
    velocity = give_way(belief, context)
    assert velocity is not None and velocity.norm() == pytest.approx(FallbackConfig.speed)
    assert velocity[0] * x > 0 and velocity[0].abs() > 2 * velocity[1:].norm(), "away from the wall"


def test_a_robot_that_sees_too_little_gives_way_to_a_mover() -> None:
    belief, context = beside_wall(-0.55)
    calm = replace(SafetyFilter(Wall(door=0.0), ROBOT), noise=NoiseModel(CALM))
    comes = Obstacle("box", BoxShape((0.1, 0.1, 0.1)), (-0.55, -0.6, 0.5), motion=ConstantVelocity((0.0, 0.5, 0.0)))
    movers = Movers((comes,))
    among = replace(context, stack=replace(context.stack, safety_filter=replace(calm, movers=movers)))
    velocity = give_way(belief, among)
    assert velocity is not None and give_way(belief, among, time=3.0) is None, "it has passed by then"
    places = belief.mean.position.double() + velocity.double() * torch.arange(1, 11)[:, None] * 0.1
    assert (movers.boxes(0.1 * np.arange(1, 11), ROBOT.body).gaps(places.numpy()) > 0).all()


def test_a_robot_that_sees_too_little_rests_where_nothing_is_near_or_known_and_on_the_ground() -> None:
    belief, context = beside_wall(-0.55)
    calm = replace(SafetyFilter(Wall(door=0.0), ROBOT), noise=NoiseModel(CALM))
    for stack in (replace(context.stack, safety_filter=calm), replace(context.stack, safety_filter=None)):
        assert give_way(belief, replace(context, stack=stack)) is None
    belief, context = beside_wall(-0.3)
    assert give_way(belief, replace(context, simulator=replace(context.simulator, robot=load("couch")))) is None


def test_a_blind_robot_is_led_away_from_a_wall_and_one_whose_belief_is_not_trusted_comes_to_rest() -> None:
    belief, context = beside_wall(-0.25)
    plan = come_to_rest(ROBOT, belief.mean, 6, 0.1)
    memory = SupervisorMemory(plan, unsure=1)
    blind = NavigationStep(1, 0.1, None, belief.mean, belief, None, None, plan, False, 0.0, 0.0, apparent=belief)
    for action, led in ((SupervisorAction.BLIND, True), (SupervisorAction.SEARCHED, False)):
        end = hold(replace(blind, recovery=action), belief.mean, plan, memory, context).states[-1]
        assert bool(end.position[0] < -0.3) is led and bool(end.velocity[0] < -0.2) is led


@pytest.mark.parametrize(("name", "rate"), [
    ("turn", -1.0), ("turn", math.nan), ("glance", -1.0), ("glance", 0.0), ("glance", math.nan), ("adrift", -0.1),
    ("adrift", math.nan),
])  # fmt: skip
def test_a_rate_to_turn_with_or_a_spread_that_is_none_is_refused_by_name(name: str, rate: float) -> None:
    with pytest.raises(InvalidInputError, match=name):
        SupervisorConfig(**{name: rate})

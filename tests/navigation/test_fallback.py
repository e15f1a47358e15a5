"""Fallback trajectories beside plans, flown where the plans are no longer safe."""

import math
from dataclasses import dataclass, field, replace

import pytest
import torch
from torch import Tensor

from nerfnav.core.steps import run_steps
from nerfnav.navigation.episode import EpisodeOutcome, NavigationStep
from nerfnav.navigation.fallback import FallbackTrajectory, SafetyFilter
from nerfnav.navigation.flight import FlightRequest, NavigateConfig, NavigationStack
from nerfnav.navigation.loop import navigate
from nerfnav.navigation.supervisor import SupervisorAction, SupervisorMemory
from nerfnav.obstacles import BoxShape, ConstantVelocity, Obstacle
from nerfnav.planner.moving.movers import Movers
from nerfnav.planner.steps import PlanOutcome, PlanResult, PlanSteps
from nerfnav.planner.trajectory import Route
from nerfnav.robots.state import Motion, RigidState
from tests.navigation.doubles import CALM, ROBOT, Oracle, StraightPlanner, draws, simulator
from tests.planner.places import Colorless, Wall

CONFIG = NavigateConfig(initial=CALM, noise=CALM)
GOAL = RigidState.at_rest((0.6, 0.5, 0.6))
CLOSED = Wall(door=0.0)


@dataclass(frozen=True)
class Sill(Colorless):
    """A wall across the way up to a height of 0.4 m."""

    def density(self, points: Tensor) -> Tensor:
        solid = (points[..., 0].abs() < 0.1) & (points[..., 2] < 0.4)
        return torch.where(solid, 200.0, 0.0).to(points)


@dataclass
class Blocked(StraightPlanner):
    """A planner that finds its way blocked in some of the replannings, counted from 0."""

    blocked: range = range(0)
    count: int = field(default=0)

    def replan(self, last: Motion, route: Route, executed: int) -> PlanSteps:
        end = yield from super().replan(last, route, executed)
        outcome = PlanOutcome.IN_COLLISION if self.count in self.blocked else end.outcome
        self.count += 1
        return replace(end, outcome=outcome)


def moving(x: float, z: float, speed: float) -> RigidState:
    return replace(RigidState.at_rest((x, 0.5, z)), velocity=torch.tensor([speed, 0.0, 0.0]))


def planned(start: RigidState, outcome: PlanOutcome) -> PlanResult:
    """Straight to the other side through whatever there is."""
    return run_steps(StraightPlanner(outcome).plan(Route(start, RigidState.at_rest((0.6, 0.5, 0.3)), 12)))


def filtered(field: Colorless, plan: PlanResult) -> tuple[FallbackTrajectory, bool]:
    """The fallback beside a plan, and whether it is flown."""
    safety_filter = SafetyFilter(field, ROBOT)
    fallback = safety_filter.make_fallback(plan, 0.1)
    return fallback, safety_filter.rejects(plan, fallback)


def test_a_fallback_that_a_mover_runs_over_is_not_safe_and_one_that_gives_way_is():
    motion = ConstantVelocity((0.0, 0.5, 0.0))
    crossing = Obstacle("box", BoxShape((0.2, 0.2, 0.2)), (0.0, -0.3, 0.6), motion=motion)
    start, movers = moving(-0.05, 0.6, 0.3), Movers((crossing,))
    plan = planned(start, PlanOutcome.IN_COLLISION)
    unaware, aware = (SafetyFilter(Wall(door=1.9), ROBOT, movers=known) for known in (None, movers))
    stays = unaware.make_fallback(plan, 0.1, 0.2)
    assert stays.safe and aware.touched_s(stays.motion, 0.2) < math.inf == aware.touched_s(stays.motion, 9.0)
    gives_way = aware.make_fallback(plan, 0.1, 0.2)
    assert gives_way.safe and aware.touched_s(gives_way.motion, 0.2) == math.inf
    assert gives_way.motion.states.position[-1, 1] != stays.motion.states.position[-1, 1] or (
        gives_way.motion.states.position[-1, 2] > stays.motion.states.position[-1, 2] + 0.05
    )


def test_beside_a_good_plan_there_is_a_fallback_that_brakes_and_the_plan_is_flown():
    start = moving(-0.7, 0.6, 1.0)
    fallback, rejected = filtered(CLOSED, planned(start, PlanOutcome.CONVERGED))
    assert fallback.safe and not rejected and fallback.bound < 0.01
    states = fallback.motion.states
    assert states.velocity[-1].norm() < 0.1 and torch.equal(states.position[0], start.position)
    for index, action in enumerate(fallback.motion.actions):  # it obeys the dynamics
        after = ROBOT.step(states[index], action, 0.1)
        torch.testing.assert_close(after.position, states.position[index + 1])


def test_in_place_of_a_plan_through_a_wall_the_robot_brakes():
    fallback, rejected = filtered(CLOSED, planned(moving(-0.7, 0.6, 1.0), PlanOutcome.IN_COLLISION))
    assert rejected and fallback.safe and fallback.motion.states.position[:, 0].max() < -0.2


def test_what_cannot_brake_before_a_wall_evades_upwards():
    start = moving(-0.5, 0.38, 1.2)
    straight, _ = filtered(Sill(), planned(start, PlanOutcome.CONVERGED))
    assert not straight.safe
    fallback, rejected = filtered(Sill(), planned(start, PlanOutcome.LIKELY_COLLISION))
    assert rejected and fallback.safe and fallback.motion.states.position[-1, 2] > 0.47


def test_a_fallback_that_is_not_safe_is_not_flown():
    fallback, rejected = filtered(CLOSED, planned(moving(-0.3, 0.6, 2.5), PlanOutcome.IN_COLLISION))
    assert not rejected and not fallback.safe and fallback.bound > 0.5


@pytest.mark.parametrize("guarded", [False, True])
def test_a_blocked_robot_holds_and_goes_on_when_there_is_a_way_again(guarded: bool):
    world = simulator()
    world.state = RigidState.at_rest((-0.6, 0.5, 0.6))
    wall, planner = Wall(door=0.0, thickness=0.02), Blocked(blocked=range(3, 6))
    stack = NavigationStack(planner, Oracle(world), safety_filter=SafetyFilter(wall, ROBOT) if guarded else None)
    events = navigate(FlightRequest(GOAL, steps=16), world, stack, CONFIG, draws(0))
    steps = [event for event in events if isinstance(event, NavigationStep)]
    held = [step.index for step in steps if step.recovery is SupervisorAction.BACKUP]
    assert held == ([3, 4, 5] if guarded else [])
    assert all((step.fallback is not None) is guarded for step in steps[1:])
    assert steps[-1].outcome is EpisodeOutcome.REACHED
    if guarded:  # the way is taken up with the time that stopping took
        assert steps[6].plan.actions.shape[-2] > steps[2].plan.actions.shape[-2]


def test_a_robot_that_waits_for_a_safe_plan_looks_for_one_less_and_less_often():
    world = simulator()
    world.state = RigidState.at_rest((-0.6, 0.5, 0.6))
    planner = Blocked(blocked=range(1, 200))
    stack = NavigationStack(planner, Oracle(world), safety_filter=SafetyFilter(CLOSED, ROBOT))
    events = navigate(FlightRequest(GOAL, steps=16), world, stack, CONFIG, draws(0))
    steps = [event for event in events if isinstance(event, NavigationStep)]
    waiting = [step for step in steps if step.recovery is SupervisorAction.BACKUP]
    assert len(waiting) > 35 and waiting[-1] is steps[-1]
    looked = [index for index, step in enumerate(waiting) if step.replan_ms > 0]
    assert looked == [0, 1, 2, 3, 4, 8, 16, 32, 64]
    assert (steps[-1].truth.position - steps[0].truth.position).norm() < 0.3


def test_a_robot_without_a_way_on_does_not_doubt_where_it_is():
    world = simulator()
    world.state = RigidState.at_rest((-0.6, 0.5, 0.6))
    stack = NavigationStack(Blocked(blocked=range(1, 3)), Oracle(world), safety_filter=SafetyFilter(CLOSED, ROBOT))
    events = navigate(FlightRequest(GOAL, steps=16), world, stack, CONFIG, draws(0))
    steps = [event for event in events if isinstance(event, NavigationStep)][:3]
    memory = SupervisorMemory(steps[0].plan)
    for step in steps[1:]:
        memory = memory.after(step.index, step.plan, step.recovery, step.belief)
    assert memory.held == 2 and memory.unsure == memory.disagreed == 0


def test_a_robot_does_not_take_off_where_no_way_is_safe_enough_and_says_what_the_safest_risks():
    def flown(most: float) -> list[NavigationStep]:
        world = simulator()
        world.state = RigidState.at_rest((-0.6, 0.5, 0.6))
        stack = NavigationStack(StraightPlanner(), Oracle(world), safety_filter=SafetyFilter(CLOSED, ROBOT))
        config = replace(CONFIG, most_risk=most)
        events = navigate(FlightRequest(GOAL, steps=16), world, stack, config, draws(0))
        return [event for event in events if isinstance(event, NavigationStep)]

    (start,) = flown(0.5)
    assert start.outcome is EpisodeOutcome.TOO_RISKY
    assert start.hits_expected is not None and start.hits_expected > 0.5
    assert start.collision_probability is not None and start.collision_probability > 0.5
    assert len(flown(1.0)) > 1

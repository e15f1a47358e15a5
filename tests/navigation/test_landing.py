"""Robots that were searched for in vain land, and blind ones go back to where they saw something."""

from dataclasses import replace

import pytest

from nerfnav.estimator import Belief, FilterConfig
from nerfnav.field.models.voxel import VoxelField
from nerfnav.navigation.episode import EpisodeOutcome, NavigationStep
from nerfnav.navigation.fallback import SafetyFilter
from nerfnav.navigation.flight import FlightContext, NavigateConfig, NavigationStack
from nerfnav.navigation.landing import may_land
from nerfnav.navigation.loop import navigate
from nerfnav.navigation.supervisor import SupervisorAction, SupervisorConfig, SupervisorState
from nerfnav.robots import RigidState, StateNoise
from tests.navigation.doubles import REQUEST, ROBOT, Oracle, StraightPlanner, draws, simulator
from tests.navigation.test_supervisor import LostFor, Unseeing
from tests.planner.objective.test_default_ends import field_of

_PLACE = ((-1.0, -1.0, -0.2), (1.0, 1.0, 1.0))
FLOOR = field_of(_PLACE, ((-1.0, -1.0, -0.2), (1.0, 1.0, 0.0)), spacing=0.04)
VOID = field_of(_PLACE, ((-1.0, -1.0, 0.9), (1.0, 1.0, 1.0)), spacing=0.04)
SLOT = field_of(_PLACE, ((-1.0, -1.0, -0.2), (1.0, 1.0, 0.25)), ((-1.0, -1.0, 0.35), (1.0, 1.0, 1.0)), spacing=0.04)
STILL = StateNoise(1e-4, 1e-4, 1e-5, 1e-5)
CONFIG = NavigateConfig(initial=STILL, noise=STILL, filter=FilterConfig(process_noise=STILL), in_sight=0.0)


def stack_in(field: VoxelField, estimator: object) -> NavigationStack:
    return NavigationStack(
        StraightPlanner(), estimator, safety_filter=SafetyFilter(field, ROBOT), camera_field=field  # type: ignore[arg-type]
    )  # fmt: skip


def flown(stack: NavigationStack, config: NavigateConfig = CONFIG, **parts: object) -> list[NavigationStep]:
    world = simulator(noise=STILL, **parts)
    stack.estimator.oracle = Oracle(world)  # type: ignore[attr-defined]
    return [step for step in navigate(REQUEST, world, stack, config, draws(1)) if isinstance(step, NavigationStep)]


@pytest.mark.parametrize(("field", "noise", "yaw", "lands"), [
    (FLOOR, STILL, 0.7, True), (VOID, STILL, 0.0, False), (FLOOR, StateNoise(), 0.0, False),
])  # fmt: skip
def test_a_robot_lands_where_free_space_reaches_level_ground_and_noise_lets_it_arrive_gently(
    field: VoxelField, noise: StateNoise, yaw: float, lands: bool
) -> None:
    config = replace(CONFIG, filter=FilterConfig(process_noise=noise))
    world = simulator()
    flight = FlightContext(REQUEST, world, stack_in(field, Oracle(world)), config, draws(1))
    belief = Belief(RigidState.at_rest((-0.4, 0.0, 0.5), yaw), STILL.covariance())
    assert may_land(belief, flight) is lands


def below_the_floor(before: RigidState, after: RigidState) -> bool:
    return bool(after.position[2] < 0.5 * ROBOT.body.extents[2])


@pytest.mark.parametrize("level", [True, False])
def test_a_lost_robot_descends_slowly_and_its_landing_is_no_collision_unless_it_is_on_a_slope(level: bool) -> None:
    stack = stack_in(FLOOR, LostFor(Oracle(simulator()), range(2, 200)))
    steps = flown(stack, contact=below_the_floor, level_contact=lambda before, after: level)
    landing = [step for step in steps if step.state is SupervisorState.LANDING]
    assert len(landing) > 5 and landing[-1] is steps[-1]
    assert min(step.truth.velocity[2].item() for step in landing) > -0.4
    assert steps[-1].outcome is (EpisodeOutcome.LOST if level else EpisodeOutcome.COLLIDED)
    assert steps[-1].touched is not level


def test_a_lost_robot_without_ground_below_comes_to_rest_in_the_air() -> None:
    steps = flown(stack_in(VOID, LostFor(Oracle(simulator()), range(2, 200))))
    assert steps[-1].outcome is EpisodeOutcome.LOST and steps[-1].recovery is SupervisorAction.LOST
    assert steps[-1].truth.velocity.norm() < 0.2


@pytest.mark.parametrize(("field", "returns"), [(FLOOR, True), (SLOT, False)])
def test_a_blind_robot_goes_back_to_its_last_view_while_three_standard_deviations_fit_into_the_clearance(
    field: VoxelField, returns: bool
) -> None:
    config = replace(CONFIG, recovery=SupervisorConfig(unseen_s=0.1, lost_s=10.0))
    steps = flown(stack_in(field, Unseeing(Oracle(simulator()), range(5, 60))), config)
    seen = steps[5].truth.position
    away = [(step.truth.position - seen).norm().item() for step in steps if step.recovery is SupervisorAction.ADRIFT]
    assert len(away) == 24 and max(away) > 0.1
    assert (min(away[6:]) < 0.06) is returns, away

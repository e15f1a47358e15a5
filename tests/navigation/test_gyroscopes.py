"""Gyroscopes in the paper's world: what they measure, and that predictions by them are honest."""

import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.steps import run_steps
from nerfnav.estimator import FastFilter
from nerfnav.estimator.core.belief import Belief
from nerfnav.estimator.core.prediction import predict
from nerfnav.geometry import Pose, so3
from nerfnav.navigation import WORLDS, NavigateConfig, NavigationStack
from nerfnav.navigation.episode import NavigationStep
from nerfnav.navigation.flight import FlightContext
from nerfnav.navigation.gyroscopes import GyroscopeAided, Gyroscopes, aid_by_gyroscopes, measured_noise
from nerfnav.navigation.physical.worlds import use_inertial_unit
from nerfnav.navigation.watching import foresee_after
from nerfnav.robots import ATTITUDE, POSITION, StateNoise
from nerfnav.robots.state import Motion, RigidState
from tests.estimator.places import CAMERA, balls
from tests.navigation.doubles import REQUEST, ROBOT, START, StraightPlanner, draws, grey, simulator

CONFIG = WORLDS["paper"].configure(NavigateConfig(imu=True))
INITIAL = StateNoise.isotropic(0.01**2)


class DynamicsAlone:
    """Predictor that looks at no picture."""

    trust_dynamics = True

    def predict(self, belief: Belief, action: torch.Tensor, dt: float, noise_factor: float = 1.0) -> object:
        noise = CONFIG.filter.process_noise.scaled(noise_factor)
        return predict(belief, action, ROBOT, dt, noise), noise

    def correct(self, *_: object) -> object:
        raise AssertionError("nobody looks")


def flown(seed: int, steps: int) -> tuple[RigidState, Belief, Belief]:
    """The truth after a noisy flight, and the beliefs with and without gyroscopes."""
    gyroscopes = Gyroscopes(seed)
    world = simulator(noise=StateNoise(), generator=draws(seed), gyroscopes=gyroscopes)
    first = Belief(START.retract(INITIAL.sample(draws(1000 + seed))), INITIAL.covariance())
    aided, alone = aid_by_gyroscopes(DynamicsAlone(), ROBOT, gyroscopes), first
    for step in range(steps):
        action = torch.tensor([ROBOT.weight * (1 + 0.1 * (-1) ** step), 2e-4, -2e-4 * (-1) ** step, 1e-4])
        world.act(action, 0.1)
        first, _ = aided.predict(first, action, 0.1)
        alone = predict(alone, action, ROBOT, 0.1, StateNoise())
    return world.state, first, alone


def test_predictions_by_gyroscopes_are_honest_and_know_the_attitude() -> None:
    nees, errors, deviations = [], [], []
    for seed in range(60):
        truth, aided, alone = flown(seed, 8)
        error = aided.mean.local(truth).double()
        nees.append(float(error @ torch.linalg.solve(aided.covariance.double(), error)))
        errors.append(error[ATTITUDE].norm().item())
        deviations.append([belief.covariance[ATTITUDE, ATTITUDE].trace().sqrt().item() for belief in (aided, alone)])
    # the mean of 60 draws of chi-squared with 12 degrees of freedom has a deviation of 0.63
    assert 12 - 4 * 0.63 < sum(nees) / len(nees) < 12 + 4 * 0.63
    left = torch.tensor(deviations).mean(0)
    assert left[0] < 0.4 * left[1] and sum(errors) / len(errors) < 1.2 * left[0]


def test_position_is_as_uncertain_as_without_gyroscopes_after_one_step() -> None:
    _, aided, alone = flown(0, 1)
    torch.testing.assert_close(aided.covariance[POSITION, POSITION], alone.covariance[POSITION, POSITION])


def test_gyroscopes_change_nothing_of_the_noise_of_a_flight() -> None:
    worlds = [simulator(noise=StateNoise(), generator=draws(3), gyroscopes=one) for one in (None, Gyroscopes(3))]
    for world in worlds:
        for _ in range(4):
            world.act(torch.tensor([ROBOT.weight, 1e-4, 0.0, 0.0]), 0.1)
    assert torch.equal(worlds[0].state.position, worlds[1].state.position)


def test_a_filter_with_gyroscopes_assumes_their_noise_and_a_robot_without_is_as_before() -> None:
    assert CONFIG.filter.process_noise == measured_noise(StateNoise(), 0.1)
    assert CONFIG.filter.process_noise.position_m == StateNoise().position_m
    assert CONFIG.recovery.lost_s > NavigateConfig().recovery.lost_s
    assert WORLDS["paper"].configure(NavigateConfig()) == NavigateConfig()


def test_a_stack_takes_the_measurements_of_its_simulator() -> None:
    stack = NavigationStack(StraightPlanner(), FastFilter(balls(), ROBOT, CAMERA, config=CONFIG.filter))
    assert use_inertial_unit(stack, simulator()) is stack
    world = simulator(noise=StateNoise(), gyroscopes=Gyroscopes(0))
    aided = use_inertial_unit(stack, world).estimator
    assert isinstance(aided, GyroscopeAided) and aided.gyroscopes is world.gyroscopes
    action = torch.tensor([ROBOT.weight, 0.0, 0.0, 0.0])
    world.act(action, 0.1)
    blind = run_steps(aided.update(Belief(START, INITIAL.covariance()), None, action, 0.1, draws(0)))
    turned = START.rotation @ world.gyroscopes.turn  # type: ignore[union-attr]
    torch.testing.assert_close(blind.posterior.mean.rotation, turned)
    assert (turned - world.state.rotation).abs().max() < 2e-3 < (START.rotation - world.state.rotation).abs().max()


def test_a_picture_is_foreseen_from_where_the_gyroscopes_put_the_robot() -> None:
    world, foreseen = simulator(noise=StateNoise(attitude_rad=0.3), gyroscopes=Gyroscopes(0)), []

    def hidden(pose: Pose, time: float) -> None:
        foreseen.append(pose)

    stack = NavigationStack(StraightPlanner(), FastFilter(balls(), ROBOT, CAMERA, config=CONFIG.filter), hidden=hidden)
    plan = Motion(RigidState.stack([START, START]), torch.tensor([[ROBOT.weight, 0.0, 0.0, 0.0]]), 0.1)
    belief = Belief(START, INITIAL.covariance())
    first = NavigationStep(0, 0.0, None, START, belief, None, None, plan, False, 0.0, 0.0)
    world.follow(plan)
    for one in (stack, use_inertial_unit(stack, world)):
        foresee_after(first, grey(None), FlightContext(REQUEST, world, one, CONFIG, draws(0)))
    truth = world.state.pose.compose(world.mount).rotation
    errors = [so3.local(pose.rotation, truth).norm().item() for pose in foreseen]
    assert errors[1] < 2e-3 < 0.1 < errors[0]


def test_in_open_loop_the_dynamics_alone_move_beliefs_with_all_their_noise() -> None:
    blind = WORLDS["paper"].configure(NavigateConfig(imu=True, open_loop=True))
    assert blind.filter.process_noise == StateNoise()


def test_an_estimator_that_takes_no_prediction_is_refused_with_the_remedy() -> None:
    with pytest.raises(InvalidInputError, match="leave --imu out, or take the estimator 'fast'"):
        aid_by_gyroscopes(object(), ROBOT, Gyroscopes(0))

"""The physical world: rigid body, motors, wind, and the loop that tracks a plan."""

import json
import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor

from nerfnav import robots
from nerfnav.core.errors import InvalidInputError
from nerfnav.core.steps import run_steps
from nerfnav.estimator import Belief, FilterOutcome, FilterResult, FilterStep, FilterUpdate
from nerfnav.geometry import Pose, so3
from nerfnav.inertial import Increments, propagate_state
from nerfnav.navigation.fallback import come_to_rest
from nerfnav.navigation.flight import NavigateConfig, NavigationStack
from nerfnav.navigation.physical.config import PhysicalConfig
from nerfnav.navigation.physical.geometric_controller import TrackingGains, correct_thrust
from nerfnav.navigation.physical.inertial import InertialInterval, InertialUnit
from nerfnav.navigation.physical.latency_compensation import LatencyCompensation
from nerfnav.navigation.physical.reference_trajectory import TrackedWaypoints
from nerfnav.navigation.physical.rigid_body import Airframe, BodyState, Powertrain, integrate
from nerfnav.navigation.physical.simulator import PhysicalSimulator, _rounded, airframe
from nerfnav.navigation.physical.wind import Wind
from nerfnav.navigation.physical.worlds import compensate_latency, configure_for_physics, make_physical_simulator
from nerfnav.navigation.simulator import Simulator
from nerfnav.navigation.supervisor import SupervisorConfig
from nerfnav.robots import Motion, ProcessNoise, RigidState
from nerfnav.tracking import ImuMeasurements
from nerfnav.tracking.preintegration import preintegrate
from tests.navigation.doubles import ROBOT, START, Oracle, StraightPlanner, draws, grey, simulator

CALM = PhysicalConfig(mass_error=0.0, drag_per_s=(0.0, 0.0, 0.0), wind_mps=0.0, gust_std_mps=(0.0, 0.0, 0.0))
HOVER = torch.tensor([[ROBOT.weight, 0.0, 0.0, 0.0]])
PERFECT = replace(CALM, gyroscope_noise=0.0, gyroscope_bias_radps=0.0, accelerometer_noise=0.0,
                  accelerometer_bias_mps2=0.0)  # fmt: skip
DATA = os.environ.get("NERFNAV_TEST_DATA")


def still(state: RigidState = START) -> Motion:
    """One step of hovering at a state."""
    return Motion(RigidState.stack([state, state]), HOVER, 0.1)


def held(world: PhysicalSimulator, steps: int) -> None:
    """Come to rest as the loop does it: each plan goes on from where the last one led."""
    start = world.state
    for _ in range(steps):
        plan = come_to_rest(ROBOT, start, 6, 0.1)
        world.follow(plan, believed=world.state)
        start = plan.states[1]


def world_of(config: PhysicalConfig, seed: int = 0, **parts: object) -> PhysicalSimulator:
    return make_physical_simulator(simulator(generator=draws(seed), **parts), config)


def body_of(case: dict) -> Airframe:
    arrays = (np.array(case[name], float) for name in ("I", "rotor_pos", "rotor_dir"))
    return Airframe(case["mass"], *arrays, case["k_eta"], case["k_m"])


@pytest.mark.slow
@pytest.mark.skipif(DATA is None, reason="NERFNAV_TEST_DATA does not say where the third-party data are")
def test_the_rigid_body_flies_as_rotorpys_with_constant_rotor_speeds() -> None:
    cases = json.loads((Path(str(DATA)) / "oracles" / "rotorpy_openloop.json").read_text())["cases"]
    for case in cases:
        frame, first = body_of(case), case["states"][0]
        wrench = frame.allocation @ (frame.thrust_coefficient * np.square(case["rotor_speeds"]))
        state = BodyState(*(np.array(first[name]) for name in "xv"), matrix(first["q"]), np.array(first["w"]))
        for expected in case["states"][1:]:
            for _ in range(5):
                state = integrate(frame, state, wrench, np.zeros(3), 0.002)
            np.testing.assert_allclose(state.position, expected["x"], atol=1e-5)
            np.testing.assert_allclose(state.velocity, expected["v"], atol=1e-5)
            np.testing.assert_allclose(state.rotation, matrix(expected["q"]), atol=1e-5)
            np.testing.assert_allclose(state.body_rate, expected["w"], atol=1e-5)


def matrix(quaternion: list[float]) -> np.ndarray:
    """R of (x, y, z, w)."""
    x, y, z, w = quaternion
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


def test_a_free_body_keeps_its_angular_momentum_and_its_energy() -> None:
    frame = Airframe(1.0, np.array([1.0, 2.0, 3.0]), np.zeros((4, 3)), np.ones(4), 1.0, 1.0, gravity=0.0)
    state = BodyState(np.zeros(3), np.ones(3), np.eye(3), np.array([1.0, 4.0, -2.0]))
    turning = [state.rotation @ (frame.inertia * state.body_rate)]
    for _ in range(1000):
        state = integrate(frame, state, np.zeros(4), np.zeros(3), 0.002)
    turning.append(state.rotation @ (frame.inertia * state.body_rate))
    np.testing.assert_allclose(turning[1], turning[0], rtol=1e-6)
    np.testing.assert_allclose(state.position, [2.0, 2.0, 2.0], rtol=1e-9)


def test_rotors_follow_with_their_lag_and_keep_their_limits() -> None:
    gains = replace(TrackingGains(), lead=1.0)
    frame = airframe(ROBOT, CALM)
    motors = Powertrain(frame, CALM, gains.lead)
    before, aim = motors.speeds.copy(), 1.1 * motors.speeds
    thrust = 4 * CALM.thrust_coefficient * aim[0] ** 2 / frame.mass
    for _ in range(10):
        motors.spin(np.array([thrust, 0.0, 0.0, 0.0]), CALM.motor_lag_s / 10)
    np.testing.assert_allclose(motors.speeds, aim + (before - aim) / np.e, rtol=1e-9)
    for _ in range(200):
        motors.spin(np.array([1e3, 0.0, 0.0, 0.0]), 0.002)
    np.testing.assert_allclose(motors.speeds, CALM.fastest_radps, rtol=1e-6)


@pytest.mark.slow
def test_a_robot_hovers_in_calm_air_and_heavier_than_it_thinks_too() -> None:
    for config in (CALM, replace(CALM, mass_error=0.1)):
        world = world_of(config)
        held(world, 8)
        assert (world.state.position - START.position).norm() < 0.05, config
        assert world.state.velocity.norm() < 0.02


def test_rotors_at_their_limits_give_up_turning_before_thrust_and_thrust_before_tilting() -> None:
    motors = Powertrain(airframe(ROBOT, CALM), CALM, TrackingGains().lead)
    for wanted, kept in (([8.0, 0.02, 0.0, 1.0], 1), ([12.0, 0.0, 0.03, -1.0], 2)):
        wrench = [motors.spin(np.array(wanted), 0.002) for _ in range(100)][-1]
        assert wrench[kept] == pytest.approx(wanted[kept], rel=1e-3)
        assert wrench[0] == pytest.approx(wanted[0] * motors.frame.mass, rel=1e-3)
        assert abs(wrench[3]) < 0.1, "of the turning as much as is left"
    wrench = [motors.spin(np.array([0.5, 0.03, 0.0, 0.0]), 0.002) for _ in range(100)][-1]
    assert wrench[1] == pytest.approx(0.03, rel=1e-3) and wrench[0] > 0.5 * motors.frame.mass


def test_the_reference_is_exact_for_cubic_motions_and_goes_on_smoothly_from_plan_to_plan() -> None:
    times = 0.1 * torch.arange(13)
    path = torch.stack([times**3 - times**2, times**2, 0.2 * times], -1)
    still = RigidState.at_rest((0.0, 0.0, 0.0))
    states = RigidState.stack([replace(still, position=place) for place in path])
    plan, flown = Motion(states, HOVER.expand(12, 4), 0.1), TrackedWaypoints()
    for step in range(6):
        rest = Motion(plan.states[step:], plan.actions[step:], 0.1)
        wanted, flown = flown.track(rest, 50, 9.81)
        if step < 3:  # of what was before the start it knows nothing
            continue
        at = 0.1 * step + 0.002 * np.arange(50)
        np.testing.assert_allclose([want.position for want in wanted], _cubic(at, 0), atol=1e-6)
        np.testing.assert_allclose([want.velocity for want in wanted], _cubic(at, 1), atol=1e-5)
        pull = _cubic(at, 2) + np.array([0.0, 0.0, 9.81])
        np.testing.assert_allclose([want.acceleration for want in wanted], pull, atol=1e-3)
        up = pull / np.linalg.norm(pull, axis=-1, keepdims=True)
        np.testing.assert_allclose([want.rotation[:, 2] for want in wanted], up, atol=1e-4)


def _cubic(t: np.ndarray, order: int) -> np.ndarray:
    """Derivatives of the path above."""
    orders = ([t**3 - t**2, t**2, 0.2 * t], [3 * t**2 - 2 * t, 2 * t, 0.2 + 0 * t], [6 * t - 2, 2 + 0 * t, 0 * t])
    return np.stack(orders[order], -1)


@pytest.mark.slow
def test_a_plan_is_tracked_in_gusts_with_a_wrong_mass() -> None:
    world, goal = world_of(PhysicalConfig(), seed=5), RigidState.at_rest((0.6, 0.3, 0.5), 0.8)
    share = torch.linspace(0, 1, 21)[:, None]
    share = share**3 * (10 - 15 * share + 6 * share.square())
    waypoints = torch.cat([START.position + share * (goal.position - START.position), 0.8 * share], -1)
    plan = ROBOT.motion(ROBOT.encode(waypoints, START, goal, 0.1), START, goal, 20, 0.1)
    for step in range(20):
        world.follow(Motion(plan.states[step:], plan.actions[step:], 0.1), believed=world.state)
        assert (world.state.position - plan.states.position[step + 1]).norm() < 0.03, step


def falling(start: RigidState) -> Motion:
    """Two steps of a plan with 0.4 of the thrust that holds the robot, four with 1.3."""
    actions = HOVER * torch.tensor([0.4, 0.4, 1.3, 1.3, 1.3, 1.3])[:, None]
    states = [start]
    for action in actions:
        states.append(ROBOT.step(states[-1], action, 0.1))
    return Motion(RigidState.stack(states), actions, 0.1)


@pytest.mark.slow
def test_a_robot_that_falls_too_slowly_is_not_turned_over_to_be_pushed_after_its_plan() -> None:
    """It had been, by 75 degrees: the plan asks for little thrust, and corrections for as much the other way."""
    world, plan = world_of(PhysicalConfig()), falling(START)
    above = START.retract(torch.tensor([0.03, 0.0, 0.06, 0.0, 0.3, 0.8, *[0.0] * 6]))
    world.kidnap(above.pose)
    upright = []
    for step in range(4):
        world.follow(plan.left_after(step), believed=above if step == 0 else world.state)
        upright.append(world.state.rotation[2, 2].item())
    assert min(upright) > 0.85, "30 degrees"
    assert (world.state.position - plan.states.position[4]).norm() < 0.1


def test_corrections_are_added_but_for_what_would_turn_the_thrust_over() -> None:
    gains, pull = TrackingGains(), np.array([1.0, -0.5, 4.0])
    small = np.array([0.3, 0.2, -0.4])
    assert correct_thrust(pull, small, gains) == pytest.approx(pull + small)
    for large in (np.array([9.0, 0.0, -9.0]), np.array([0.0, -30.0, 0.0]), -3 * pull, 20 * pull):
        found = correct_thrust(pull, large, gains)
        along = found @ pull / np.linalg.norm(pull)
        assert along >= gains.least_thrust * np.linalg.norm(pull) - 1e-9
        assert np.linalg.norm(np.cross(found, pull)) / np.linalg.norm(pull) <= gains.lean * along + 1e-9
    assert correct_thrust(pull, 20 * pull, gains) == pytest.approx(21 * pull), "more thrust turns nothing"
    assert correct_thrust(np.zeros(3), small, gains) == pytest.approx(small)


def test_gyroscopes_tell_the_body_rate_of_now_while_rotors_change_it() -> None:
    quiet = replace(CALM, gyroscope_noise=0.0, gyroscope_bias_radps=0.0, camera_delay=0)
    turning = replace(START, body_rate=torch.tensor([2.0, -1.5, 0.3]))
    world = world_of(quiet)
    world._put(turning)
    world.follow(Motion(RigidState.stack([START, START]), HOVER, 0.01), believed=turning)
    assert (world.state.body_rate - turning.body_rate).norm() > 0.2, "it is slowed down"
    _, after = world.felt
    assert (after.increments.rate - world.state.body_rate).norm() < 2e-3


def moved(state: RigidState, felt: tuple[InertialInterval, InertialInterval]) -> RigidState:
    """A state moved on by what was felt, biases and all."""
    gravity = torch.tensor([0.0, 0.0, -ROBOT.config.gravity], dtype=torch.float64)
    for each in felt:
        state = propagate_state(state.to(torch.float64), each.increments, gravity, each.duration)
    return state.to(torch.float32)


def test_inertial_increments_move_any_state_as_the_robot_was_moved() -> None:
    world = world_of(PERFECT)
    turning = replace(START, velocity=torch.tensor([0.6, -0.2, 0.1]), body_rate=torch.tensor([0.5, -0.4, 0.3]))
    world._put(turning)
    world.follow(still(turning))
    after = moved(turning, world.felt)
    torch.testing.assert_close(after.position, world.state.position, atol=1e-4, rtol=0)
    elsewhere = turning.moved_to(Pose(so3.from_yaw(torch.tensor(1.0)) @ turning.rotation, torch.zeros(3)))
    there = moved(elsewhere, world.felt)
    turned = [before.rotation.T @ after.rotation for before, after in ((turning, world.state), (elsewhere, there))]
    torch.testing.assert_close(turned[1], turned[0], atol=1e-4, rtol=0)


def test_wind_is_as_strong_as_it_says_and_the_same_for_the_same_seed() -> None:
    config = PhysicalConfig()
    gusts = []
    for seed in range(300):
        wind = Wind(config, draws(seed))
        level = wind._axes.T @ wind.blow(0.01)
        later = [wind._axes.T @ wind.blow(0.1) for _ in range(8)][-1]
        gusts.append([level, later])
    along = np.array(gusts) - [config.wind_mps, 0.0, 0.0]
    np.testing.assert_allclose(along.std(0), [config.gust_std_mps] * 2, rtol=0.15)
    np.testing.assert_allclose(along.mean(0), np.zeros((2, 3)), atol=0.15)
    assert abs(np.corrcoef(along[:, 0, 0], along[:, 1, 0])[0, 1] - np.exp(-1.6)) < 0.15
    one, same = Wind(config, draws(4)), Wind(config, draws(4))
    assert np.array_equal(one.blow(0.1), same.blow(0.1))


@pytest.mark.slow
def test_wind_carries_off_a_robot_that_does_not_see() -> None:
    blown, calm = world_of(PhysicalConfig(), seed=2), world_of(replace(PhysicalConfig(), wind_mps=0.0), seed=2)
    for world in (blown, calm):
        for _ in range(10):
            world.follow(still(world.state))
    assert blown.state.velocity[:2].norm() > calm.state.velocity[:2].norm()


def test_equal_seeds_give_equal_physical_worlds() -> None:
    one, same, other = (world_of(PhysicalConfig(), seed) for seed in (3, 3, 4))
    for world in (one, same, other):
        world.follow(still())
    assert torch.equal(one.state.position, same.state.position)
    assert not torch.equal(one.state.position, other.state.position)


def test_pictures_are_late_and_some_are_lost() -> None:
    seen: list[Pose] = []

    def camera(pose: Pose) -> torch.Tensor:
        seen.append(pose)
        return grey(pose)

    moving = replace(START, velocity=torch.tensor([1.0, 0.0, 0.0]))
    world = world_of(replace(CALM, dropped_share=0.0), camera=camera)
    world._put(moving)
    world.follow(come_to_rest(ROBOT, moving, 6, 0.1))
    world.look()
    behind = float(world.state.position[0] - seen[0].position[0])
    assert behind == pytest.approx(1 / 30, abs=0.004)
    lossy = world_of(replace(CALM, dropped_share=0.5))
    lost = sum(lossy.look() is None for _ in range(400))
    assert 150 < lost < 250


@dataclass(frozen=True)
class Seeing:
    """Sees where a robot is, or was when a picture was taken, but for this noise of a coordinate [m, rad]."""

    where: Callable[[], RigidState]
    noise: float = 1e-4
    trust_dynamics: bool = True

    def correct(
        self, prediction: Belief, image: Tensor | None, generator: torch.Generator, noise: ProcessNoise | None = None
    ) -> FilterUpdate:
        prior, pose = prediction.covariance.double(), [0, 1, 2, 6, 7, 8]
        seen = prediction.mean.local(self.where())[pose] + self.noise * torch.randn(6, generator=generator)
        gain = torch.linalg.solve(prior[pose][:, pose] + self.noise**2 * torch.eye(6).double(), prior[pose]).T
        mean = prediction.mean.retract((gain @ seen.double()).float())
        kept = torch.eye(12).double()
        kept[:, pose] -= gain
        covariance = kept @ prior @ kept.T + self.noise**2 * gain @ gain.T
        posterior = Belief(mean, covariance.float())
        step = FilterStep(0, mean, 0.0, 0.0, torch.zeros(0, 2, dtype=torch.long), torch.zeros(0))
        yield step
        return FilterResult(posterior, FilterOutcome.UPDATED, step)


def looking_at(world: PhysicalSimulator, trust_dynamics: bool = True) -> LatencyCompensation:
    """Follows the robot of a world by pictures that arrive late, each coordinate known to 2 mm or 2 mrad."""
    pictures = Seeing(lambda: _rounded(world._seen[0]), 0.002, trust_dynamics)
    return LatencyCompensation(pictures, lambda: world.felt, world.world.delay_s, world.unit)


def of_rest(duration: float) -> InertialInterval:
    """What a unit without errors feels of a robot that stays level and goes on at its speed."""
    lift = torch.tensor([0.0, 0.0, 9.81], dtype=torch.float64)
    zero, eye = torch.zeros(3).double(), torch.eye(3).double()
    return InertialInterval(Increments(eye, lift * duration, 0.5 * lift * duration**2, zero), duration, 0.002)


def test_a_late_picture_corrects_the_belief_of_then() -> None:
    moving = replace(START, velocity=torch.tensor([1.0, 0.0, 0.0]))
    then = replace(moving, position=moving.position + torch.tensor([0.2, 0.0, 0.0]))
    felt, unit = (of_rest(0.1 - 1 / 30), of_rest(1 / 30)), InertialUnit(PhysicalConfig(), draws(0)).describe(9.81)
    late = LatencyCompensation(Seeing(lambda: then, 1e-6), lambda: felt, 1 / 30, unit)
    begun = Belief(replace(moving, position=moving.position + 0.1), torch.diag(torch.tensor([1.0] * 3 + [1e-8] * 9)))
    last = run_steps(late.update(begun, grey(None), HOVER[0], 0.1, draws(0)))
    expected = then.position + torch.tensor([1 / 30, 0.0, 0.0])
    torch.testing.assert_close(last.posterior.mean.position, expected, atol=1e-5, rtol=0)
    with pytest.raises(InvalidInputError, match=r"time steps longer than 0\.02 s"):
        list(late.update(Belief(START, torch.eye(12)), grey(None), HOVER[0], 0.02, draws(0)))


def test_what_was_felt_is_freed_of_biases_as_single_measurements_are() -> None:
    """The same unit as its measurements one by one have it, in a turn of 0.3 rad."""
    rate, force = torch.tensor([1.0, -2.0, 2.0]).double(), torch.tensor([0.5, -1.0, 9.0]).double()
    biases = torch.tensor([0.02, -0.01, 0.03, 0.2, 0.1, -0.3]).double()
    times = torch.arange(0, 0.1001, 0.002, dtype=torch.float64)
    series = ImuMeasurements(times, rate.expand(len(times), 3), force.expand(len(times), 3))
    unit = replace(InertialUnit(PhysicalConfig(), draws(0)).describe(9.81), gyro=0.02, accel=0.3)
    raw, exact = (preintegrate(series, 0.0, 0.1, known, unit) for known in (torch.zeros(6).double(), biases))
    found = InertialInterval(raw.increments, 0.1, 0.002).without(biases, unit)
    for ours, theirs in zip(found.increments, exact.increments, strict=True):
        torch.testing.assert_close(ours, theirs, atol=2e-4, rtol=0)
    for block, theirs in zip(_blocks(found.by_biases), _blocks(exact.by_biases), strict=True):
        assert (block - theirs).norm() <= 0.1 * theirs.norm(), "they are of one force for the whole time"
    sizes = exact.covariance.diagonal().sqrt()
    apart = (found.covariance - exact.covariance) / (sizes[:, None] * sizes)
    assert apart.abs().max() < 0.05, "as shares of the standard deviations"
    assert found.rate_variance == pytest.approx(exact.rate_variance)


def _blocks(matrix: Tensor) -> list[Tensor]:
    return [block for rows in matrix.split(3) for block in rows.split(3, 1)]


@pytest.mark.slow
@pytest.mark.nightly
def test_biases_of_the_unit_are_learned_and_beliefs_are_honest() -> None:
    off, nees, late_off = [], [], []
    for seed in range(6):
        world = world_of(replace(PhysicalConfig(), dropped_share=0.0), seed)
        late = looking_at(world)
        belief, generator = Belief(START, 1e-4 * torch.eye(12)), draws(100 + seed)
        for index in range(40):
            world.follow(still(START), believed=belief.mean)
            belief = run_steps(late.update(belief, grey(None), HOVER[0], 0.1, generator)).posterior
            error = belief.mean.local(world.state).double()
            nees.append(float(error @ torch.linalg.solve(belief.covariance.double(), error)))
            if index >= 20:
                late_off.append(float(error[:3].norm()))
        assert late._last is not None
        errors = late._last.biases - torch.from_numpy(world._inertial._bias)
        off.append(errors / late._last.covariance.diagonal()[:6].sqrt())
        assert late._last.covariance.diagonal()[3:6].max() < 0.5 * PhysicalConfig.accelerometer_bias_mps2**2
    assert torch.stack(off).square().mean() < 2.5, "1 is honest"
    assert 8 < np.mean(nees) < 16, "12 is honest"
    assert np.mean(late_off) < 0.004


def test_a_belief_that_comes_from_elsewhere_keeps_what_is_known_of_the_biases() -> None:
    felt, unit = (of_rest(0.1 - 1 / 30), of_rest(1 / 30)), InertialUnit(PhysicalConfig(), draws(0)).describe(9.81)
    late = LatencyCompensation(Seeing(lambda: START, 0.002), lambda: felt, 1 / 30, unit)
    belief = Belief(START, 1e-4 * torch.eye(12))
    for _ in range(10):
        belief = run_steps(late.update(belief, grey(None), HOVER[0], 0.1, draws(0))).posterior
    assert late._last is not None
    known, widened = late._last.covariance, late._with_biases(replace(belief, covariance=4 * belief.covariance))
    assert torch.equal(widened.covariance, known) and not widened.cross.any()
    assert late._with_biases(belief) is late._last


def test_nothing_is_learned_of_biases_from_an_estimator_that_only_starts_at_the_prediction() -> None:
    world = world_of(PhysicalConfig())
    late = looking_at(world, trust_dynamics=False)
    belief = Belief(START, 1e-4 * torch.eye(12))
    for _ in range(5):
        world.follow(still(START), believed=belief.mean)
        belief = run_steps(late.update(belief, grey(None), HOVER[0], 0.1, draws(0))).posterior
    assert late._last is not None and not late._last.biases.any()


def test_a_unit_without_errors_leaves_no_belief_without_a_spread() -> None:
    world = world_of(PERFECT)
    late = looking_at(world)
    belief, generator = Belief(START, 1e-4 * torch.eye(12)), draws(0)
    for _ in range(20):
        world.follow(still(START), believed=belief.mean)
        belief = run_steps(late.update(belief, grey(None), HOVER[0], 0.1, generator)).posterior
    torch.linalg.cholesky(belief.covariance.double())
    assert belief.mean.local(world.state)[:3].norm() < 0.003


def test_estimators_that_only_move_beliefs_themselves_are_refused_in_one_sentence() -> None:
    world = world_of(PhysicalConfig())
    with pytest.raises(InvalidInputError, match=r"Oracle has no `correct`.*fly it in the paper's world"):
        compensate_latency(NavigationStack(StraightPlanner(), Oracle(world)), world)
    assert compensate_latency(stack := NavigationStack(StraightPlanner(), Oracle(world)), simulator()) is stack


def test_a_robot_that_sees_nothing_holds_before_it_may_be_five_centimetres_off() -> None:
    config = configure_for_physics(NavigateConfig())
    assert config.recovery.widest * 7.815**0.5 == pytest.approx(0.05, abs=0.001), "95 % of chi-squared of 3 numbers"
    assert config.recovery.sure == config.recovery.widest < NavigateConfig().recovery.widest
    careful = SupervisorConfig(widest=0.01, sure=0.005)
    assert configure_for_physics(NavigateConfig(recovery=careful)).recovery == replace(careful, open=1.0, lost_s=3.0)


@pytest.mark.parametrize("name", ["quadrotor", "quadrotor25", "crazyflie", "x500"])
def test_each_quadrotor_can_do_in_the_physical_world_what_plans_ask_of_it(name: str) -> None:
    robot = robots.load(name)
    world = PhysicalConfig()
    frame = airframe(robot, world)
    most = len(frame.rotors) * frame.thrust_coefficient * world.fastest_radps**2
    least = len(frame.rotors) * frame.thrust_coefficient * world.slowest_radps**2
    assert robot.config.max_thrust < most < 1.5 * robot.config.max_thrust
    assert least < 0.1 * robot.weight
    half = 0.5 * np.array(robot.config.extents[:2])
    assert (np.abs(frame.rotors[:, :2]) < half).all() and np.abs(frame.rotors[:, :2]).min() > 0.5 * half.min()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["quadrotor25", "crazyflie", "x500"])
def test_quadrotors_of_other_sizes_hold_their_place_in_the_wind(name: str) -> None:
    robot = robots.load(name)
    world = make_physical_simulator(Simulator(robot, START, grey, draws(0), noise=None))
    start = world.state
    for _ in range(15):
        plan = come_to_rest(robot, start, 6, 0.1)
        world.follow(plan, believed=world.state)
        start = plan.states[1]
    assert (world.state.position - START.position).norm() < 0.15 and world.state.velocity.norm() < 0.3


def test_other_robots_than_quadrotors_are_refused_in_one_sentence() -> None:
    couch = Simulator(robots.load("couch"), START, grey, draws(0))
    with pytest.raises(InvalidInputError, match="made for quadrotors, and a couch is none"):
        make_physical_simulator(couch)


@pytest.mark.parametrize(("name", "value"), [("motor_lag_s", 0.0), ("dropped_share", 1.5), ("mass_error", -1.0)])
def test_parameters_that_no_world_has_are_refused(name: str, value: float) -> None:
    with pytest.raises(InvalidInputError, match=name):
        PhysicalConfig(**{name: value})


def test_a_robot_that_holds_comes_to_rest() -> None:
    moving = replace(START, velocity=torch.tensor([0.8, 0.0, 0.0]))
    world = world_of(CALM)
    world._put(moving)
    held(world, 10)
    assert world.state.velocity.norm() < 0.1, world.state.velocity

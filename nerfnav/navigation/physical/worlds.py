"""Choice of the world of a flight: the paper's, which adds noise to the dynamics, or the physical one."""

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, replace
from typing import Literal, TypeVar

from nerfnav.core.errors import InvalidInputError
from nerfnav.estimator import Corrector
from nerfnav.navigation.flight import NavigateConfig, NavigationStack
from nerfnav.navigation.gyroscopes import aid_by_gyroscopes, measured_noise
from nerfnav.navigation.physical.config import LEASH_M, UNSEEN_M, PhysicalConfig
from nerfnav.navigation.physical.latency_compensation import LatencyCompensation
from nerfnav.navigation.physical.simulator import PhysicalSimulator
from nerfnav.navigation.simulator import Simulator
from nerfnav.robots import Quadrotor, Robot

T = TypeVar("T")
WorldName = Literal["paper", "physical"]
"""Names of the worlds, as options take them."""
_LOST_S = 3.0
"""Time without an informative picture after which a search counts as in vain [s]: an inertial unit keeps the attitude,
and so the velocity, much longer than the dynamics alone."""
_STEP_S = 0.1
"""Time step for which a robot with gyroscopes expects noise [s]."""
_GENTLE = 0.4
"""Share of the angular acceleration that costs as much as the weight, for plans that rotors have to follow."""


def _keep(thing: T) -> T:
    return thing


def make_physical_simulator(simulator: Simulator, world: PhysicalConfig | None = None) -> PhysicalSimulator:
    """Move a simulator to the physical world. Raises InvalidInputError for other robots than quadrotors."""
    return PhysicalSimulator(
        simulator.robot, simulator.state, simulator.camera, simulator.generator, simulator.mount,
        noise=None, contact=simulator.contact, box=simulator.box, level_contact=simulator.level_contact,
        movers=simulator.movers, camera_at=simulator.camera_at,
        world=world or PhysicalConfig(),
    )  # fmt: skip


def configure_for_physics(config: NavigateConfig) -> NavigateConfig:
    """Configure a flight whose plans a controller tracks, and whose robot soon holds where it sees nothing."""
    most = min(config.recovery.widest, UNSEEN_M)
    recovery = replace(
        config.recovery, widest=most, sure=min(config.recovery.sure, most), open=1.0, lost_s=_LOST_S
    )
    return replace(config, leash_m=config.leash_m or LEASH_M, recovery=recovery)


def configure_for_gyroscopes(config: NavigateConfig) -> NavigateConfig:
    """Configure a flight in the paper's world for gyroscopes, where the robot has them; in open loop the dynamics alone
    move beliefs."""
    if not config.imu or config.open_loop:
        return config
    process = measured_noise(config.filter.process_noise, _STEP_S)
    return replace(
        config, filter=replace(config.filter, process_noise=process), recovery=replace(config.recovery, lost_s=_LOST_S)
    )


def reserve_control_authority(robot: Robot) -> Robot:
    """Tighten the limits of a robot for planning, so that the controller can reject wind and turn.

    That leaves two thirds of its speed and tilt, half of its body rate, five sixths of its thrust and twice the floor
    of it. Torques cost more: between two time steps rotors cannot follow a thrust that jumps.
    """
    if not isinstance(robot, Quadrotor):
        return robot
    config = robot.config
    own = replace(
        config, max_thrust=config.max_thrust / 1.2, max_tilt=config.max_tilt / 1.5, max_speed=config.max_speed / 1.5,
        max_rate=config.max_rate / 2, thrust_floor=2 * config.thrust_floor,
        angular_acceleration=config.angular_acceleration * _GENTLE,
    )  # fmt: skip
    careful = copy(robot)
    careful.config, careful.bounds = own, own.bounds
    careful.action_weights = Quadrotor(own).action_weights
    return careful


def use_inertial_unit(
    stack: NavigationStack, simulator: Simulator, last: NavigationStack | None = None
) -> NavigationStack:
    """Add what the robot's inertial unit measures to the estimator, as `compensate_latency` does in the physical world;
    return the stack unchanged without a unit. Raises InvalidInputError for an estimator that cannot use it."""
    if simulator.gyroscopes is None:
        return compensate_latency(stack, simulator, last)
    return replace(stack, estimator=aid_by_gyroscopes(stack.estimator, simulator.robot, simulator.gyroscopes))


def compensate_latency(
    stack: NavigationStack, simulator: Simulator, last: NavigationStack | None = None
) -> NavigationStack:
    """Add latency compensation to the estimator in the physical world; return the stack unchanged in the paper's.

    With a `last` stack, whose field has changed in flight, the compensation goes on with its inertial belief.
    Raises InvalidInputError for an estimator whose beliefs inertial measurements cannot propagate, and for a robot that
    watches.
    """
    if not isinstance(simulator, PhysicalSimulator):
        return stack
    if stack.watch is not None:
        raise InvalidInputError(
            "pictures of the physical world come late, and a robot that watches compares them with where it is: take "
            "--world paper, or leave --watch and obstacles that are seen out"
        )
    if not isinstance(stack.estimator, Corrector):
        raise InvalidInputError(
            f"{type(stack.estimator).__name__} has no `correct` and `trust_dynamics` (nerfnav.estimator.Corrector), "
            "and in the physical world inertial measurements move beliefs: fly it in the paper's world"
        )
    if last is not None and isinstance(last.estimator, LatencyCompensation):
        last.estimator.estimator = stack.estimator
        return replace(stack, estimator=last.estimator)
    late = LatencyCompensation(stack.estimator, lambda: simulator.felt, simulator.world.delay_s, simulator.unit)
    return replace(stack, estimator=late)


@dataclass(frozen=True)
class World:
    """Adjustments of a flight to its world."""

    configure: Callable[[NavigateConfig], NavigateConfig] = _keep
    """Configuration of the flight."""
    planning_robot: Callable[[Robot], Robot] = _keep
    """Robot with the limits of planners."""
    simulate: Callable[[Simulator], Simulator] = _keep
    """Simulator of the world."""


WORLDS: dict[WorldName, World] = {
    "paper": World(configure_for_gyroscopes),
    "physical": World(configure_for_physics, reserve_control_authority, make_physical_simulator),
}
"""Worlds by name."""

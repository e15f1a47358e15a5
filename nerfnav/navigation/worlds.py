"""Which world a flight happens in: the paper's, which adds noise to the dynamics, or the physical one."""

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, replace
from typing import Literal, TypeVar

from nerfnav.estimator import FilterConfig, StateNoise
from nerfnav.navigation.mission import NavigateConfig, Pilot
from nerfnav.navigation.physical.config import INERTIAL, LEASH_M, UNSEEN_M, PhysicalConfig
from nerfnav.navigation.physical.inertial import Strapdown
from nerfnav.navigation.physical.late_pictures import LatePictures
from nerfnav.navigation.physical.simulator import PhysicalSimulator
from nerfnav.navigation.simulator import Simulator
from nerfnav.robots import Quadrotor, Robot

T = TypeVar("T")
WorldName = Literal["paper", "physical"]
"""The worlds, as users choose them."""
_GENTLE = 0.4
"""Share of the angular acceleration that plans take for as dear as the weight where rotors have to bring it about."""


def _unchanged(thing: T) -> T:
    return thing


def in_physical_world(simulator: Simulator, world: PhysicalConfig | None = None) -> PhysicalSimulator:
    """The same robot in the physical world. Raises InvalidInputError for other robots than quadrotors."""
    return PhysicalSimulator(
        simulator.robot, simulator.state, simulator.camera, simulator.generator, simulator.mount,
        noise=None, contact=simulator.contact, world=world or PhysicalConfig(),
    )  # fmt: skip


def expecting_physics(config: NavigateConfig) -> NavigateConfig:
    """A flight whose plans are tracked, and whose filter expects inertial measurements, unless it was told what."""
    most = min(config.recovery.widest, UNSEEN_M)
    recovery = replace(config.recovery, widest=most, sure=min(config.recovery.sure, most))
    config = replace(config, leash_m=config.leash_m or LEASH_M, recovery=recovery)
    if config.filter.process_noise != StateNoise():
        return config
    return replace(config, filter=replace(config.filter, process_noise=INERTIAL))


def with_reserve(robot: Robot) -> Robot:
    """The robot as planners take it that leave it something to fight the wind and to turn with.

    That is two thirds of its speed and tilt, half of its body rate, five sixths of its thrust and twice the floor of
    it. Torques are dearer: between two time steps rotors cannot do what thrust asks of them that jumps.
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


def with_inertial_unit(robot: Robot) -> Robot:
    """The robot as an estimator takes it that has inertial measurements in place of actions."""
    return Strapdown(robot.config) if isinstance(robot, Quadrotor) else robot


def with_late_pictures(pilot: Pilot, simulator: Simulator, config: FilterConfig) -> Pilot:
    """A pilot who knows that pictures are late in the physical world; the same one in the paper's."""
    if not isinstance(simulator, PhysicalSimulator):
        return pilot
    late = LatePictures(
        pilot.estimator, with_inertial_unit(simulator.robot), lambda: simulator.felt, simulator.world.delay_s,
        config.process_noise,
    )  # fmt: skip
    return replace(pilot, estimator=late)


@dataclass(frozen=True)
class World:
    """What a flight is told of the world that it happens in; nothing of the paper's."""

    expecting: Callable[[NavigateConfig], NavigateConfig] = _unchanged
    """How it is flown."""
    planned: Callable[[Robot], Robot] = _unchanged
    """The robot as planners take it."""
    estimated: Callable[[Robot], Robot] = _unchanged
    """The robot as estimators take it."""
    simulated: Callable[[Simulator], Simulator] = _unchanged
    """Where it happens."""


WORLDS: dict[WorldName, World] = {
    "paper": World(),
    "physical": World(expecting_physics, with_reserve, with_inertial_unit, in_physical_world),
}
"""Name to world."""

"""Choice of the world of a flight: the paper's, which adds noise to the dynamics, or the physical one."""

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, replace
from typing import Literal, TypeVar

from nerfnav.core.errors import InvalidInputError
from nerfnav.estimator import Corrector
from nerfnav.navigation.flight import NavigateConfig, NavigationStack
from nerfnav.navigation.physical.config import LEASH_M, UNSEEN_M, PhysicalConfig
from nerfnav.navigation.physical.latency_compensation import LatencyCompensation
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


def make_physical_simulator(simulator: Simulator, world: PhysicalConfig | None = None) -> PhysicalSimulator:
    """The same robot in the physical world. Raises InvalidInputError for other robots than quadrotors."""
    return PhysicalSimulator(
        simulator.robot, simulator.state, simulator.camera, simulator.generator, simulator.mount,
        noise=None, contact=simulator.contact, world=world or PhysicalConfig(),
    )  # fmt: skip


def configure_for_physics(config: NavigateConfig) -> NavigateConfig:
    """A flight whose plans are tracked, by a robot that soon holds where it sees nothing."""
    most = min(config.recovery.widest, UNSEEN_M)
    recovery = replace(config.recovery, widest=most, sure=min(config.recovery.sure, most))
    return replace(config, leash_m=config.leash_m or LEASH_M, recovery=recovery)


def reserve_control_authority(robot: Robot) -> Robot:
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


def compensate_latency(pilot: NavigationStack, simulator: Simulator) -> NavigationStack:
    """A pilot with an inertial unit, who knows that pictures are late in the physical world; the same one in the
    paper's. Raises InvalidInputError for an estimator whose beliefs nothing else can move.
    """
    if not isinstance(simulator, PhysicalSimulator):
        return pilot
    if not isinstance(pilot.estimator, Corrector):
        raise InvalidInputError(
            f"{type(pilot.estimator).__name__} has no `correct` and `trust_dynamics` (nerfnav.estimator.Corrector), "
            "and in the physical world inertial measurements move beliefs: fly it in the paper's world"
        )
    late = LatencyCompensation(pilot.estimator, lambda: simulator.felt, simulator.world.delay_s, simulator.unit)
    return replace(pilot, estimator=late)


@dataclass(frozen=True)
class World:
    """What a flight is told of the world that it happens in; nothing of the paper's."""

    expecting: Callable[[NavigateConfig], NavigateConfig] = _unchanged
    """How it is flown."""
    planned: Callable[[Robot], Robot] = _unchanged
    """The robot as planners take it."""
    simulated: Callable[[Simulator], Simulator] = _unchanged
    """Where it happens."""


WORLDS: dict[WorldName, World] = {
    "paper": World(),
    "physical": World(configure_for_physics, reserve_control_authority, make_physical_simulator),
}
"""Name to world."""

"""Which world a flight happens in: the paper's, which adds noise to the dynamics, or the physical one."""

from dataclasses import replace
from typing import Literal

from nerfnav.estimator import FilterConfig, StateNoise
from nerfnav.navigation.physical.config import MISFIT, PhysicalConfig
from nerfnav.navigation.physical.late_pictures import LatePictures
from nerfnav.navigation.physical.simulator import PhysicalSimulator
from nerfnav.navigation.replan import NavigateConfig, Pilot
from nerfnav.navigation.simulator import Simulator

WorldName = Literal["paper", "physical"]
"""The worlds, as users choose them."""


def in_physical_world(simulator: Simulator, world: PhysicalConfig | None = None) -> PhysicalSimulator:
    """The same robot in the physical world. Raises InvalidInputError for other robots than quadrotors."""
    return PhysicalSimulator(
        simulator.robot, simulator.state, simulator.camera, simulator.generator, simulator.mount,
        noise=None, contact=simulator.contact, world=world or PhysicalConfig(),
    )  # fmt: skip


def expecting_physics(config: NavigateConfig) -> NavigateConfig:
    """A flight whose filter expects the physical world's disturbances, unless it was told what to expect."""
    if config.filter.process_noise != StateNoise():
        return config
    return replace(config, filter=replace(config.filter, process_noise=MISFIT))


def with_late_pictures(pilot: Pilot, simulator: Simulator, config: FilterConfig) -> Pilot:
    """A pilot who knows that pictures are late in the physical world; the same one in the paper's."""
    if not isinstance(simulator, PhysicalSimulator):
        return pilot
    late = LatePictures(pilot.estimator, simulator.robot, simulator.world.delay_s, config.process_noise)
    return replace(pilot, estimator=late)

"""Where a hand puts a robot that it carries away ("kidnapped robot"): somewhere else, where its body fits."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import torch

from nerfnav.geometry import Box, Pose, so3
from nerfnav.robots import RigidState


@dataclass(frozen=True)
class CarryConfig:
    """How far a robot is carried."""

    nearest: float = 0.5
    """Least distance [m]."""
    farthest: float = 1.0
    """Largest level distance [m]; farther only where the body fits nowhere nearer."""
    rise: float = 0.1
    """Most that it is carried up or down [m]."""
    turn: float = 0.5
    """Most that its heading is turned [rad]."""
    tries: int = 500
    """Places that are tried near, and as many anywhere."""


def carried_away(
    state: RigidState,
    box: Box,
    fits: Callable[[RigidState], bool],
    generator: torch.Generator,
    config: CarryConfig | None = None,
) -> Pose | None:
    """T_world_body of a random place in `box` where the body fits, tilted as it is; None where no try finds one.

    `fits` is asked about places at any height: for a robot on the ground it has to settle them first.
    """
    config = CarryConfig() if config is None else config
    for place in _places(state, box, generator, config):
        turn = so3.from_yaw(config.turn * _between(-1, 1, generator)).to(state.rotation)
        there = state.moved_to(Pose(turn @ state.rotation, place))
        if box.contains(place) and (place - state.position).norm() >= config.nearest and fits(there):
            return there.pose
    return None


def _places(
    state: RigidState, box: Box, generator: torch.Generator, config: CarryConfig
) -> Iterator[torch.Tensor]:
    for _ in range(config.tries):
        angle = _between(0, 2 * torch.pi, generator)
        away = _between(config.nearest, config.farthest, generator)
        rise = config.rise * _between(-1, 1, generator)
        yield state.position + torch.stack([away * angle.cos(), away * angle.sin(), rise])
    for _ in range(config.tries):
        yield box.lower + box.size * torch.rand(3, generator=generator)


def _between(low: float, high: float, generator: torch.Generator) -> torch.Tensor:
    return low + (high - low) * torch.rand((), generator=generator)

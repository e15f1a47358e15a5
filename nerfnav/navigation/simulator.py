"""Simulated robot: the true state, moved by the dynamics plus noise, and seen through a camera.

The simulator knows neither field nor mesh: its camera and its sense of touch are callables, so that a mesh, a field
or real hardware may stand behind them.

A kidnapped robot is put down at a random pose where its body fits (`sample_kidnap_pose`).
"""


from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from nerfnav.geometry import FORWARD_MOUNT, Box, Pose, so3
from nerfnav.robots import Motion, RigidState, Robot, StateNoise

CameraFunction = Callable[[Pose], UInt8[Tensor, "height width 3"]]
"""The picture that is taken at T_world_camera."""
ContactFunction = Callable[[RigidState, RigidState], bool]
"""Whether the body touches anything between two states."""
_WORLD = 2**32
"""Added to the seed of a flight for the world's own draws: no seed that a flight is given is as large."""


def world_generator(seed: int) -> torch.Generator:
    """Draws of the world in a flight of that seed: the same ones, whatever filter and loop draw meanwhile."""
    return torch.Generator().manual_seed(_WORLD + seed)


@dataclass
class Simulator:
    """Where the robot truly is; `act` moves it."""

    robot: Robot
    """What moves."""
    state: RigidState
    """The truth, which estimator and planner never see."""
    camera: CameraFunction
    """Takes the pictures."""
    generator: torch.Generator
    """Decides the noise."""
    mount: Pose = field(default_factory=lambda: FORWARD_MOUNT)
    """T_body_camera."""
    noise: StateNoise | None = field(default_factory=StateNoise)
    """Disturbs the state after every step (paper: 2 cm, 0.02 rad, half on the rates); None: a perfect world."""
    contact: ContactFunction | None = None
    """Says whether the body touched anything on its way; None where there is no ground truth."""

    def act(self, action: Float[Tensor, " a"], dt: float, gust: StateNoise | None = None) -> bool:
        """Apply an action for `dt` [s], and a gust where there is one; tells whether the body touched anything."""
        before = self.state
        self.state = self.robot.step(before, action, dt)
        for disturbance in (self.noise, gust):
            if disturbance is not None:
                self.state = self.state.retract(disturbance.sample(self.generator))
        self.state = self.robot.settled(self.state, before)
        return self.contact is not None and self.contact(before, self.state)

    def follow(self, plan: Motion, gust: StateNoise | None = None, believed: RigidState | None = None) -> bool:
        """Do the first step of a plan, otherwise as `act`; `believed` is where the robot believes to be, by default
        where the plan begins."""
        return self.act(plan.actions[0], plan.dt, gust)

    def carry(self, pose: Pose) -> None:
        """Put the robot at T_world_body; it goes on moving as it did, in its own axes."""
        self.state = self.robot.settled(self.state.moved_to(pose), self.state)

    def look(self) -> UInt8[Tensor, "height width 3"] | None:
        """The picture that the robot's camera gives now; None where it gives none."""
        return self.camera(self.state.pose.compose(self.mount))


@dataclass(frozen=True)
class KidnapConfig:
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


def sample_kidnap_pose(
    state: RigidState,
    box: Box,
    fits: Callable[[RigidState], bool],
    generator: torch.Generator,
    config: KidnapConfig | None = None,
) -> Pose | None:
    """T_world_body of a random place in `box` where the body fits, tilted as it is; None where no try finds one.

    `fits` is asked about places at any height: for a robot on the ground it has to settle them first.
    """
    config = KidnapConfig() if config is None else config
    for place in _places(state, box, generator, config):
        turn = so3.from_yaw(config.turn * _between(-1, 1, generator)).to(state.rotation)
        there = state.moved_to(Pose(turn @ state.rotation, place))
        if box.contains(place) and (place - state.position).norm() >= config.nearest and fits(there):
            return there.pose
    return None


def _places(
    state: RigidState, box: Box, generator: torch.Generator, config: KidnapConfig
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

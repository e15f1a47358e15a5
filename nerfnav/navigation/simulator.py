"""Simulated robot: the true state, moved by the dynamics plus noise, with a camera.

The simulator knows neither field nor mesh: camera and contact are callables, so that a mesh, a field or real hardware
may stand behind them; of the field it has the box alone. A kidnapped robot is moved to a random pose where its body
fits (`sample_kidnap_pose`).
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from nerfnav.core.errors import require_seed
from nerfnav.geometry import FORWARD_MOUNT, Box, Pose, so3
from nerfnav.navigation.gust import GustStrength
from nerfnav.navigation.gyroscopes import Gyroscopes
from nerfnav.planner import Movers
from nerfnav.robots import Motion, RigidState, Robot, StateNoise

CameraFunction = Callable[[Pose], UInt8[Tensor, "height width 3"]]
"""Picture from T_world_camera."""
CameraAtTime = Callable[[Pose, float], UInt8[Tensor, "height width 3"]]
"""Picture from T_world_camera at a time of the flight [s]."""
ContactFunction = Callable[[RigidState, RigidState], bool]
"""Contact check: whether the body touches anything between two states."""
_WORLD = 2**32
"""Added to the seed of a flight for the draws of the world: seeds of flights are smaller."""


def world_generator(seed: int) -> torch.Generator:
    """Return the generator of the world in a flight of that seed, apart from that of filter and loop.

    Raises InvalidNumberError for what is no seed.
    """
    require_seed(seed=seed)
    return torch.Generator().manual_seed(_WORLD + seed)


@dataclass
class Simulator:
    """True state of the robot; `act` moves it."""

    robot: Robot
    """Its dynamics."""
    state: RigidState
    """The truth, which estimator and planner never see."""
    camera: CameraFunction
    """Its camera."""
    generator: torch.Generator
    """Draws the noise."""
    mount: Pose = field(default_factory=lambda: FORWARD_MOUNT)
    """T_body_camera."""
    noise: StateNoise | None = field(default_factory=StateNoise)
    """Noise of the state after every step (paper: 2 cm, 0.02 rad, half on the rates); None: no noise."""
    contact: ContactFunction | None = None
    """Contact check of the body's path; None without ground truth."""
    box: Box | None = None
    """Box of the field, which ends the world of the flight; None: it has no end."""
    level_contact: ContactFunction | None = None
    """Check whether the first contact of the body's path is with level surfaces alone, as in a landing; None: none
    is."""
    movers: Movers | None = None
    """Obstacles that move; None: all stands."""
    camera_at: CameraAtTime | None = None
    """Camera of a world with movers; None: `camera` shows all."""
    time: float = 0.0
    """Time of the flight [s]."""
    gyroscopes: Gyroscopes | None = None
    """Gyroscopes, which measure each time step; None without them, and in the physical world, which has its own."""

    def is_outside(self, state: RigidState) -> bool:
        """Check whether the body has left the box: its centre is beyond it by more than the body's radius.

        Noise pushes a robot that flies along the border a little beyond it, and it comes back.
        """
        if self.box is None:
            return False
        lower, upper, position = self.box.lower, self.box.upper, state.position
        beyond = (lower - position).clamp_min(0) + (position - upper).clamp_min(0)
        return not beyond.norm().item() <= self.robot.body.radius  # nor is a position that is not finite inside

    def act(self, action: Float[Tensor, " a"], dt: float, gust: GustStrength | StateNoise | None = None) -> bool:
        """Apply an action for `dt` [s], and a gust; return whether the body touched anything."""
        before = self.state
        self.state = self.robot.step(before, action, dt)
        for disturbance in (self.noise, gust):
            if disturbance is not None:
                self.state = self.state.retract(disturbance.sample(self.generator))
        self.state = self.robot.settled(self.state, before)
        if self.gyroscopes is not None:
            self.gyroscopes.measure(before, self.state, dt)
        return self.advance(before, self.state, dt)

    def advance(self, before: RigidState, after: RigidState, seconds: float) -> bool:
        """Let time pass while the robot moves between two states; return whether its body touches anything on the way,
        movers too."""
        began, self.time = self.time, self.time + seconds
        if self.contact is not None and self.contact(before, after):
            return True
        if self.movers is None:
            return False
        states = RigidState.stack([before, after])
        return bool(self.movers.least_gaps(states, seconds, self.robot.body, began).min() <= 0)

    def follow(
        self, plan: Motion, gust: GustStrength | StateNoise | None = None, believed: RigidState | None = None
    ) -> bool:
        """Apply the first action of a plan, as `act` does; `believed` is the believed state, by default the start of
        the plan."""
        return self.act(plan.actions[0], plan.dt, gust)

    def kidnap(self, pose: Pose) -> None:
        """Move the robot to T_world_body; its velocity stays the same in its own axes."""
        self.state = self.robot.settled(self.state.moved_to(pose), self.state)

    def look(self) -> UInt8[Tensor, "height width 3"] | None:
        """Take the picture of the robot's camera; None where none arrives."""
        return self.picture(self.state, self.time)

    def picture(self, state: RigidState, time: float) -> UInt8[Tensor, "height width 3"]:
        """Take the picture from a state at a time of the flight [s]."""
        pose = state.pose.compose(self.mount)
        return self.camera(pose) if self.camera_at is None else self.camera_at(pose, time)


@dataclass(frozen=True)
class KidnapConfig:
    """Range of the pose to which a robot is kidnapped."""

    nearest: float = 0.5
    """Least distance [m]."""
    farthest: float = 1.0
    """Largest level distance [m]; farther only where the body fits nowhere nearer."""
    rise: float = 0.1
    """Largest change of its height [m]."""
    turn: float = 0.5
    """Largest change of its heading [rad]."""
    tries: int = 500
    """Positions that are tried near, and as many anywhere."""


def sample_kidnap_pose(
    state: RigidState,
    box: Box,
    fits: Callable[[RigidState], bool],
    generator: torch.Generator,
    config: KidnapConfig | None = None,
) -> Pose | None:
    """Sample a random T_world_body in `box` where the body fits, tilted as it is; None where no try finds one.

    `fits` checks positions at any height: for a robot on the ground it has to settle them first.
    """
    config = KidnapConfig() if config is None else config
    for position in _positions(state, box, generator, config):
        turn = so3.from_yaw(config.turn * _between(-1, 1, generator)).to(state.rotation)
        there = state.moved_to(Pose(turn @ state.rotation, position))
        if box.contains(position) and (position - state.position).norm() >= config.nearest and fits(there):
            return there.pose
    return None


def _positions(
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

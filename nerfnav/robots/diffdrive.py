"""Differential drive: two wheels that roll and never slide; it heads where it drives, or against it.

Notation: psi heading, e(psi) its unit vector, s signed forward speed, w yaw rate, a and alpha their changes. A step
of dt is driven along an arc with the speeds that the robot has at its start; the wheels change speed at its end:

    psi_{t+1} = psi_t + w_t dt                      w_{t+1} = w_t + alpha_t dt
    p_{t+1} = p_t + s_t dt S(w_t dt) e((psi_t + psi_{t+1}) / 2)      s_{t+1} = s_t + a_t dt,   v_t = s_t e(psi_t)

with S(x) = sin(x/2) / (x/2), so the motion between the times is exact and nothing slides. Positions alone would be a
flat output, but a singular one: at standstill a velocity has no direction. Speeds and headings have no such place, so
they are what is free,

    free = (s_1 .. s_{N-1}, psi_2 .. psi_{N-1}),  2 N - 3 numbers,

and the two equations that are left, p_N = goal, are met by moving the free numbers to the nearest ones that lead
there (arcs.py), a smooth map wherever the robot moves at all. Forward and reverse are signs of s. `DiffDriveMap` is
the same map compiled.
"""

import math
from dataclasses import dataclass, replace
from typing import final

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import so3
from nerfnav.robots.arcs import EXACT, ROUNDS, TYPICAL_SPEED, TYPICAL_TURN, Path, chord, closed, displacements, unit
from nerfnav.robots.body import Body
from nerfnav.robots.flat_map import FlatMap
from nerfnav.robots.ground import (
    GroundRobot,
    about_z,
    forward_speed,
    heading,
    headings_along,
    row,
    spatial,
    unwrap_angles,
    wrap_angle,
)
from nerfnav.robots.kernels import arcs
from nerfnav.robots.kernels import diffdrive as kernels
from nerfnav.robots.robot import Limit
from nerfnav.robots.state import Motion, RigidState


@dataclass(frozen=True)
class DiffDriveConfig:
    """A small robot on two wheels."""

    extents: tuple[float, float, float] = (0.14, 0.12, 0.08)
    """Edge lengths of the body [m]."""
    point_counts: tuple[int, int, int] = (7, 6, 4)
    """Body points along each edge at which densities are taken: 2.5 cm apart."""
    max_speed: float = 3.0
    """Forward or reverse [m/s]."""
    max_yaw_rate: float = 8.0
    """[rad/s]"""
    max_acceleration: float = 12.0
    """[m/s^2]"""
    max_yaw_acceleration: float = 60.0
    """[rad/s^2]"""
    name: str = "diffdrive"
    """Name for users."""

    @property
    def body(self) -> Body:
        """A box, filled with points."""
        return Body.box(self.extents, self.point_counts)

    @property
    def bounds(self) -> tuple[Limit, ...]:
        """Return the limits of the robot."""
        most = {
            ("speed", "m/s"): self.max_speed,
            ("yaw rate", "rad/s"): self.max_yaw_rate,
            ("acceleration", "m/s^2"): self.max_acceleration,
            ("yaw acceleration", "rad/s^2"): self.max_yaw_acceleration,
        }
        return tuple(Limit(*named, -value, value) for named, value in most.items())


@final
class DiffDriveMap(FlatMap):
    """Free numbers of a differential drive to its motion, and back."""

    def __init__(self, config: DiffDriveConfig, start: RigidState, goal: RigidState, steps: int, dt: float) -> None:
        """Map the free numbers of a robot with these constants between `start` and `goal`."""
        self.dt = dt
        start, goal = start.to(torch.float64), goal.to(torch.float64)
        self._ends = np.array([_end(state) for state in (start, goal)])
        self._goal = goal.position.numpy()
        self._bounds = np.array(
            [config.max_speed, config.max_yaw_rate, config.max_acceleration, config.max_yaw_acceleration]
        )
        self._iterates = np.empty((ROUNDS + 1, 2 * steps - 3))
        self._speeds = np.empty(steps + 1)
        self.position, self.velocity, self.rate = np.zeros((3, steps + 1, 3))
        self.position[:, 2], self.velocity[0] = start.position[2].item(), start.velocity.numpy()
        self.rotation, self.action = np.empty((steps + 1, 3, 3)), np.empty((steps, 2))
        self._slopes = (np.zeros(steps + 1), np.zeros(steps + 1), np.zeros((steps, 2)))

    def forward(self, free: np.ndarray) -> None:
        """Implement FlatMap with compiled kernels."""
        self._clear_slopes()
        short = self._ends[1, 2] - free[-1]
        self._last = free[-1] + math.atan2(math.sin(short), math.cos(short))
        self._rounds = arcs.close(free, self._ends, self._last, self.dt, self._iterates)
        kernels.motion(
            self._iterates[self._rounds], self._ends, self._last, self.dt, self._speeds, self.position,
            self.velocity, self.rotation, self.rate, self.action,
        )  # fmt: skip
        self._reached = bool(np.linalg.norm(self.position[-1, :2] - self._goal[:2]) < EXACT)
        self.position[-1, 2] = self.position[0, 2]
        if self._reached:
            self.position[-1] = self._goal

    def limits(self, weight: float) -> float:
        """Implement FlatMap with compiled kernels."""
        self._clear_slopes()
        return kernels.limits(self._speeds, self.rate, self.action, self._bounds, weight, *self._slopes)

    def backward(self, by_position: np.ndarray, by_rotation: np.ndarray, by_action: np.ndarray) -> np.ndarray:
        """Implement FlatMap with compiled kernels."""
        of_speed, of_rate, of_action = self._slopes
        if self._reached:  # the goal does not move
            by_position[-1] = 0.0
        gradient = np.empty(self._iterates.shape[1])
        kernels.adjoint(
            self._iterates, self._rounds, self._ends, self._last, self.dt, by_position, by_rotation,
            of_speed.copy(), of_rate.copy(), by_action + of_action, gradient,
        )  # fmt: skip
        return gradient


def _end(state: RigidState) -> list[float]:
    return [
        *state.position[:2].tolist(), heading(state).item(), forward_speed(state).item(), state.body_rate[2].item()
    ]  # fmt: skip


_ALONG = 0.8
"""Share of a path along its waypoints' headings from which on these are taken as they are."""
_SLIDING = 1e-3
"""Speed across the heading [m/s] that counts as none."""


class DiffDrive(GroundRobot):
    """A ground robot with two numbers to choose: forward and yaw acceleration."""

    action_names = ("acceleration_mps2", "yaw_acceleration_radps2")
    minimum_steps = 4

    def __init__(self, config: DiffDriveConfig | None = None) -> None:
        """A differential drive with the given constants (default: those of DiffDriveConfig)."""
        self.config = config = DiffDriveConfig() if config is None else config
        self.name = config.name
        self.body = config.body
        self.action_weights = (config.max_acceleration**-2, config.max_yaw_acceleration**-2)
        self.bounds = config.bounds

    def step(self, state: RigidState, action: Float[Tensor, "*batch 2"], dt: float) -> RigidState:
        """The state after `dt` [s]; a velocity across the heading, which wheels do not have, is lost."""
        speed = forward_speed(state)
        rate = state.body_rate[..., 2]
        turn = rate * dt
        along = spatial(unit(0.5 * turn) * (speed * dt * chord(turn))[..., None], 0.0)
        rotation = state.rotation @ so3.from_yaw(turn)
        faster = speed + action[..., 0] * dt
        return RigidState(
            state.position + (state.rotation @ along[..., None])[..., 0],
            rotation[..., 0] * faster[..., None],
            rotation,
            about_z(rate + action[..., 1] * dt),
        )

    def hold(self, state: RigidState, dt: float, turn: float = 0.0) -> Float[Tensor, "2"]:
        """Brake as fast as it can."""
        most = torch.tensor([self.config.max_acceleration, self.config.max_yaw_acceleration]).to(state.velocity)
        wanted = torch.stack([-forward_speed(state), turn - state.body_rate[2]]) / dt
        return wanted.clamp(-most, most)

    def free_numbers(self, steps: int) -> int:
        """Count the free numbers over `steps` steps."""
        if steps < self.minimum_steps:
            raise InvalidInputError(f"a differential drive needs at least {self.minimum_steps} steps, not {steps}")
        return 2 * steps - 3

    def motion(
        self, free: Float[Tensor, "*batch k"], start: RigidState, goal: RigidState, steps: int, dt: float
    ) -> Motion:
        """The motion through the nearest free numbers that lead to the goal.

        Only a robot that rests all the time has none near that would move it sideways: it then ends beside the goal.
        """
        expected = self.free_numbers(steps)
        if free.shape[-1] != expected:
            raise InvalidInputError(f"{steps} steps have {expected} free numbers, not {free.shape[-1]}")
        path = self._path(free, start, goal, dt)
        away = goal.position[..., :2] - start.position[..., :2]
        speeds, yaw = path(closed(free, path, away, dt))
        batch = free.shape[:-1]
        way, begin = displacements(speeds, yaw, dt).cumsum(-2), row(start.position[..., :2], batch)
        position = spatial(torch.cat([begin, begin + way], -2), start.position[..., 2])
        reached = (way[..., -1:, :] - away).square().sum(-1, keepdim=True) < EXACT**2
        end = torch.where(reached, row(goal.position, batch), position[..., -1:, :])
        speeds = torch.cat([speeds, row(forward_speed(goal), batch)], -1)
        rates = torch.cat([yaw.diff(dim=-1) / dt, row(goal.body_rate[..., 2], batch)], -1)
        velocity = spatial(speeds[..., None] * unit(yaw), 0.0)
        states = RigidState(
            torch.cat([position[..., :-1, :], end], -2),
            torch.cat([row(start.velocity, batch), velocity[..., 1:, :]], -2),
            so3.from_yaw(yaw),
            about_z(rates),
        )
        return Motion(states, torch.stack([speeds.diff(dim=-1), rates.diff(dim=-1)], -1) / dt, dt)

    def _path(self, free: Tensor, start: RigidState, goal: RigidState, dt: float) -> Path:
        """Free numbers to speeds and headings between the ends; the last heading is the one nearest to `free`."""
        batch, speeds = free.shape[:-1], (free.shape[-1] + 1) // 2
        first = row(forward_speed(start), batch)
        held = [row(heading(start) + start.body_rate[..., 2] * late, batch) for late in (0.0, dt)]
        last = free[..., -1:] + wrap_angle(row(heading(goal), batch) - free[..., -1:])

        def path(numbers: Tensor) -> tuple[Tensor, Tensor]:
            turns = numbers[..., speeds:]
            return torch.cat([first, numbers[..., :speeds]], -1), torch.cat([*held, turns, last], -1)

        return path

    def compiled_map(self, start: RigidState, goal: RigidState, steps: int, dt: float) -> DiffDriveMap | None:
        """See Robot; None for a robot that was given other bounds than those of its config."""
        return DiffDriveMap(self.config, start, goal, steps, dt) if self.bounds == self.config.bounds else None

    def encode(
        self, waypoints: Float[Tensor, "times 4"], start: RigidState, goal: RigidState, dt: float
    ) -> Float[Tensor, " k"]:
        """Speeds and headings along waypoints: their headings where these point along the path, else the path's own."""
        steps = waypoints.shape[0] - 1
        self.free_numbers(steps)
        moved = waypoints[1:, :2] - waypoints[:-1, :2]
        given = (moved * unit(waypoints[:-1, 3])).sum(-1)
        if given.abs().sum() >= _ALONG * moved.norm(dim=-1).sum():
            yaw = unwrap_angles(torch.cat([heading(start)[None], waypoints[1:, 3]]))
            return torch.cat([given[1:] / dt, yaw[2:-1]])
        yaw, gear = headings_along(moved, heading(start), heading(goal))
        return torch.cat([gear * moved[1:].norm(dim=-1) / dt, yaw[2:-1]])

    def free_scales(self, free: Float[Tensor, " k"]) -> Float[Tensor, " k"]:
        """Half a metre per second, half a radian."""
        scales = torch.full_like(free, TYPICAL_SPEED)
        scales[(free.shape[-1] + 1) // 2 :] = TYPICAL_TURN
        return scales

    def demands(self, motion: Motion) -> dict[str, Float[Tensor, "*batch times"]]:
        """Forward speed [m/s], yaw rate [rad/s], and how fast both change."""
        states = motion.states
        return {
            "speed": forward_speed(states),
            "yaw rate": states.body_rate[..., 2],
            "acceleration": motion.actions[..., 0],
            "yaw acceleration": motion.actions[..., 1],
        }

    def settled(self, state: RigidState, before: RigidState) -> RigidState:
        """Level, at the height that it had, and without what velocity is across its heading."""
        level = super().settled(state, before)
        return replace(level, velocity=level.rotation[..., 0] * forward_speed(level)[..., None])

    def check_ends(self, start: RigidState, goal: RigidState) -> None:
        """Both ends must be level, at one height, and move along their headings."""
        super().check_ends(start, goal)
        for which, state in (("start", start), ("goal", goal)):
            if bool((state.rotation[..., 1] * state.velocity).sum(-1).abs().max() > _SLIDING):
                raise InvalidInputError(f"a differential drive cannot slide: its {which} moves across its heading")

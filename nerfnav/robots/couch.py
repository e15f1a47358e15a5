"""Couch: a long box on the ground that can be pushed in any direction and turned at will.

Notation: m mass, J inertia about z, F force in the plane of the world, tau torque about z; p, v, R, w as in
robots/state.py, psi the heading. Dynamics, explicit Euler with step dt, as for the quadrotor:

    p_{t+1} = p_t + v_t dt        v_{t+1} = v_t + F_t / m dt
    psi_{t+1} = psi_t + w_t dt    w_{t+1} = w_t + tau_t / J dt

All of it is linear, so positions and headings alone give every state and action. With N steps between fixed full
states the first two poses follow from the start, the last one and the last velocities from the goal. Free are

    free = (x_2, y_2, .. x_{N-1}, y_{N-1}, psi_2 .. psi_{N-1}),  3 (N - 2) numbers

`CouchMap` is the same map compiled.
"""

from dataclasses import dataclass
from typing import final

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import so3
from nerfnav.robots.body import Body
from nerfnav.robots.flat_map import FlatMap
from nerfnav.robots.ground import GroundRobot, about_z, heading, row, spatial, wrap_angle
from nerfnav.robots.kernels import couch as kernels
from nerfnav.robots.robot import TYPICAL_MOVE, TYPICAL_TURN, Limit, length, speed
from nerfnav.robots.state import Motion, RigidState
from nerfnav.robots.thrust import shortened


@dataclass(frozen=True)
class CouchConfig:
    """A couch in the paper's scale: three times as long as wide."""

    mass: float = 1.0
    """m [kg]."""
    extents: tuple[float, float, float] = (0.3, 0.1, 0.1)
    """Edge lengths of the body [m]."""
    point_counts: tuple[int, int, int] = (13, 5, 5)
    """Body points along each edge at which densities are taken: 2.5 cm apart."""
    max_speed: float = 3.0
    """[m/s]"""
    max_yaw_rate: float = 6.0
    """[rad/s]"""
    max_force: float = 15.0
    """[N]"""
    name: str = "couch"
    """Name for users."""

    @property
    def inertia(self) -> float:
        """J of a solid box [kg m^2]."""
        return self.mass * (self.extents[0] ** 2 + self.extents[1] ** 2) / 12

    @property
    def body(self) -> Body:
        """A box, filled with points."""
        return Body.box(self.extents, self.point_counts)

    @property
    def bounds(self) -> tuple[Limit, ...]:
        """Return the limits of the robot."""
        return (
            Limit("speed", "m/s", upper=self.max_speed),
            Limit("yaw rate", "rad/s", -self.max_yaw_rate, self.max_yaw_rate),
            Limit("force", "N", upper=self.max_force),
        )


@final
class CouchMap(FlatMap):
    """Free numbers of a couch to its motion, and back."""

    def __init__(self, config: CouchConfig, start: RigidState, goal: RigidState, steps: int, dt: float) -> None:
        """Map the free numbers of a robot with these constants between `start` and `goal`."""
        self.dt, self._count = dt, 3 * (steps - 2)
        self._ends = np.stack([_end(state) for state in (start, goal)])
        self._constants = np.array([config.mass, config.inertia, dt, start.position[2].item()])
        self._bounds = np.array([config.max_speed, config.max_yaw_rate, config.max_force])
        self.position, self.velocity, self.rate = np.empty((3, steps + 1, 3))
        self.rotation, self.action = np.empty((steps + 1, 3, 3)), np.empty((steps, 3))
        self._slopes = (np.zeros((steps + 1, 2)), np.zeros(steps + 1), np.zeros((steps, 3)))

    def forward(self, free: np.ndarray) -> None:
        """Implement FlatMap with compiled kernels."""
        self._clear_slopes()
        kernels.motion(
            free, self._ends, self._constants, self.position, self.velocity, self.rotation, self.rate, self.action
        )

    def limits(self, weight: float) -> float:
        """Implement FlatMap with compiled kernels."""
        self._clear_slopes()
        return kernels.limits(self.velocity, self.rate, self.action, self._bounds, weight, *self._slopes)

    def backward(self, by_position: np.ndarray, by_rotation: np.ndarray, by_action: np.ndarray) -> np.ndarray:
        """Implement FlatMap with compiled kernels."""
        of_velocity, of_rate, of_action = self._slopes
        gradient = np.empty(self._count)
        kernels.adjoint(
            self._constants, by_position, by_rotation, of_velocity.copy(), of_rate.copy(), by_action + of_action,
            gradient,
        )  # fmt: skip
        return gradient


def _end(state: RigidState) -> np.ndarray:
    state = state.to(torch.float64)
    planar = [state.position[:2].numpy(), state.velocity[:2].numpy()]
    return np.concatenate([*planar, [heading(state).item(), state.body_rate[2].item()]])


class Couch(GroundRobot):
    """A ground robot with three numbers to choose: force [N] along the world's x and y, torque [N m]."""

    action_names = ("force_x_n", "force_y_n", "torque_z_nm")
    minimum_steps = 3

    def __init__(self, config: CouchConfig | None = None) -> None:
        """A couch with the given constants (default: those of CouchConfig)."""
        self.config = config = CouchConfig() if config is None else config
        self.name = config.name
        self.body = config.body
        torque = config.inertia * config.max_force / config.mass / (0.5 * config.extents[0])
        self.action_weights = (config.max_force**-2, config.max_force**-2, torque**-2)
        self.bounds = config.bounds

    @property
    def deceleration(self) -> float:
        """Deceleration by the largest force [m/s^2]."""
        return self.config.max_force / self.config.mass

    def step(self, state: RigidState, action: Float[Tensor, "*batch 3"], dt: float) -> RigidState:
        """The state after `dt` [s] under (force x, force y [N], torque [N m]), which are held meanwhile."""
        push = spatial(action[..., :2] / self.config.mass, 0.0)
        return RigidState(
            state.position + state.velocity * dt,
            state.velocity + push * dt,
            so3.retract(state.rotation, state.body_rate * dt),
            state.body_rate + about_z(action[..., 2] / self.config.inertia) * dt,
        )

    def hold(self, state: RigidState, dt: float, turn: float = 0.0) -> Float[Tensor, "3"]:
        """Push against the velocity, as much as the greatest force can."""
        config = self.config
        force = shortened(-config.mass / dt * state.velocity, config.max_force)
        return torch.cat([force[:2], config.inertia / dt * (turn - state.body_rate[2:])])

    def free_numbers(self, steps: int) -> int:
        """Count the free numbers over `steps` steps."""
        if steps < self.minimum_steps:
            raise InvalidInputError(f"a couch needs at least {self.minimum_steps} steps, not {steps}")
        return 3 * (steps - 2)

    def motion(
        self, free: Float[Tensor, "*batch k"], start: RigidState, goal: RigidState, steps: int, dt: float
    ) -> Motion:
        """The flatness map above; headings turn the shorter way from one to the next."""
        expected = self.free_numbers(steps)
        if free.shape[-1] != expected:
            raise InvalidInputError(f"{steps} steps have {expected} free numbers, not {free.shape[-1]}")
        batch, inner = free.shape[:-1], steps - 2
        first = start.position + start.velocity * dt
        middle = free[..., : 2 * inner].unflatten(-1, (inner, 2))
        ends = [row(point[..., :2], batch) for point in (start.position, first, goal.position)]
        position = torch.cat([*ends[:2], middle, ends[2]], -2)
        between = position[..., 2:, :] - position[..., 1:-1, :]
        velocity = torch.cat(
            [row(start.velocity[..., :2], batch), between / dt, row(goal.velocity[..., :2], batch)], -2
        )
        rate = start.body_rate[..., 2]
        fixed = [row(angle, batch) for angle in (heading(start), heading(start) + rate * dt, heading(goal))]
        yaw = torch.cat([*fixed[:2], free[..., 2 * inner :], fixed[2]], -1)
        turning = wrap_angle(yaw[..., 2:] - yaw[..., 1:-1]) / dt
        yaw_rate = torch.cat([row(rate, batch), turning, row(goal.body_rate[..., 2], batch)], -1)
        force = self.config.mass * velocity.diff(dim=-2) / dt
        torque = self.config.inertia * yaw_rate.diff(dim=-1) / dt
        states = RigidState(
            spatial(position, start.position[..., 2]), spatial(velocity, 0.0), so3.from_yaw(yaw), about_z(yaw_rate)
        )
        return Motion(states, torch.cat([force, torque[..., None]], -1), dt)

    def compiled_map(self, start: RigidState, goal: RigidState, steps: int, dt: float) -> CouchMap | None:
        """See Robot; None for a robot that was given other bounds than those of its config."""
        return CouchMap(self.config, start, goal, steps, dt) if self.bounds == self.config.bounds else None

    def encode(
        self, waypoints: Float[Tensor, "times 4"], start: RigidState, goal: RigidState, dt: float
    ) -> Float[Tensor, " k"]:
        """The inner waypoints and headings as they are."""
        self.free_numbers(waypoints.shape[0] - 1)
        return torch.cat([waypoints[2:-1, :2].flatten(), waypoints[2:-1, 3]])

    def free_scales(self, free: Float[Tensor, " k"]) -> Float[Tensor, " k"]:
        """A few body widths, half a radian."""
        scales = torch.full_like(free, TYPICAL_MOVE)
        scales[2 * free.shape[-1] // 3 :] = TYPICAL_TURN
        return scales

    def demands(self, motion: Motion) -> dict[str, Float[Tensor, "*batch times"]]:
        """Speed [m/s], yaw rate [rad/s], force [N]."""
        return {
            "speed": speed(motion),
            "yaw rate": motion.states.body_rate[..., 2],
            "force": length(motion.actions[..., :2]),
        }

"""The quadrotor's compiled flatness map, and its dynamics in compiled kernels."""

from typing import final

import numpy as np
import torch
from torch import Tensor

from nerfnav.robots.flat_map import FlatMap
from nerfnav.robots.kernels import quadrotor as kernels
from nerfnav.robots.kernels import quadrotor_hold as hold_kernels
from nerfnav.robots.kernels import quadrotor_limits as limit_kernels
from nerfnav.robots.kernels import quadrotor_steps as step_kernels
from nerfnav.robots.quadrotor_config import QuadrotorConfig
from nerfnav.robots.state import Motion, RigidState


@final
class QuadrotorMap(FlatMap):
    """Free numbers of a quadrotor to its motion, and back."""

    def __init__(self, config: QuadrotorConfig, start: RigidState, goal: RigidState, steps: int, dt: float) -> None:
        """Map the free numbers of a robot with these constants between `start` and `goal`."""
        self.dt = dt
        self._bounds = np.array(
            [config.weight, config.thrust_floor, config.max_thrust, config.max_tilt, config.max_speed, config.max_rate]
        )
        ends = [part for state in (start, goal) for part in (state.position, state.velocity, state.body_rate)]
        self._ends = np.stack([part.double().numpy() for part in ends])
        self._attitudes = np.stack([start.rotation.double().numpy()] * 2 + [goal.rotation.double().numpy()])
        kernels.turn(self._attitudes[0], start.body_rate.double().numpy() * dt, self._attitudes[1])
        self._constants = _constants_of(config, dt)
        self._beyond = np.empty((steps + 2, 3))
        self.position = self._beyond[:-1]
        self.velocity = np.empty((steps + 1, 3))
        self.rotation = np.empty((steps + 1, 3, 3))
        self.rate = np.empty((steps + 1, 3))
        self.action = np.empty((steps, 4))
        self._slopes = (np.zeros((steps + 1, 3)), np.zeros((steps + 1, 3)), np.zeros((steps, 4)))
        self._penalised = False

    @property
    def constants(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Ends, attitudes, constants and bounds, as the kernels have them."""
        return self._ends, self._attitudes, self._constants, self._bounds

    def forward(self, free: np.ndarray) -> None:
        """See FlatMap."""
        self._free, self._penalised = free, False
        kernels.motion(
            free, self._ends, self._attitudes, self._constants, self._beyond, self.velocity, self.rotation,
            self.rate, self.action,
        )  # fmt: skip

    def limits(self, weight: float) -> float:
        """See FlatMap."""
        self._penalised = True
        for slope in self._slopes:
            slope[:] = 0.0
        return limit_kernels.limits(
            self.velocity, self.rotation, self.rate, self.action, self._bounds, weight, self.dt, *self._slopes
        )

    def backward(self, by_position: np.ndarray, by_rotation: np.ndarray, by_action: np.ndarray) -> np.ndarray:
        """See FlatMap."""
        if self._penalised:
            of_position, of_rotation, of_action = self._slopes
            by_position, by_rotation, by_action = (
                by_position + of_position, by_rotation + of_rotation, by_action + of_action,
            )  # fmt: skip
        beyond = np.concatenate([by_position, np.zeros((1, 3))])
        gradient = np.empty_like(self._free)
        kernels.adjoint(
            self._free, self._attitudes, self._constants, self.velocity, self.rotation, self.rate, self.action,
            beyond, by_rotation, by_action, gradient,
        )  # fmt: skip
        return gradient


def way(config: QuadrotorConfig, start: RigidState, actions: np.ndarray, dt: float) -> np.ndarray:
    """Positions (n + 1, 3) [m] under actions (n, 4) of `dt` [s], the start included."""
    positions = np.empty((len(actions) + 1, 3))
    step_kernels.roll_out(_arrays_of(start), actions, _constants_of(config, dt), positions)
    return positions


def held(config: QuadrotorConfig, start: RigidState, wanted: Tensor, dt: float, rest: float) -> Motion:
    """What comes of holding, for up to n steps with wanted velocities (n, 3) [m/s]: see `Robot.held`."""
    most = len(wanted)
    states = (np.empty((most + 1, 3)), np.empty((most + 1, 3)), np.empty((most + 1, 3, 3)), np.empty((most + 1, 3)))
    holding = (config.braking, config.max_braking, config.levelling, config.thrust_floor * config.weight)
    actions = np.empty((most, 4))
    steps = hold_kernels.hold_out(
        _arrays_of(start), wanted.double().numpy(), _constants_of(config, dt), np.array(holding), rest, states, actions
    )
    position, velocity, rotation, rate = (torch.from_numpy(part[: steps + 1]).to(start.position) for part in states)
    moved = RigidState(position, velocity, rotation, rate)
    return Motion(moved, torch.from_numpy(actions[:steps]).to(start.position), dt)


def first_thrusts(
    config: QuadrotorConfig, start: RigidState, wanted: np.ndarray, dt: float, floor: float
) -> np.ndarray:
    """f_0 and f_1 [N] that lead nearest to the positions (2, 3) [m] wanted at steps 2 and 3; at least `floor` [N]."""
    thrusts = np.empty(2)
    step_kernels.first_thrusts(_arrays_of(start), wanted, _constants_of(config, dt), floor, thrusts)
    return thrusts


def _constants_of(config: QuadrotorConfig, dt: float) -> np.ndarray:
    """Mass, inertia, gravity and time step, as the kernels have them."""
    return np.array([config.mass, *config.inertia, config.gravity, dt])


def _arrays_of(state: RigidState) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Position, velocity, attitude and body rate of one state, as the kernels have them."""
    parts = (state.position, state.velocity, state.rotation, state.body_rate)
    position, velocity, rotation, rate = (part.detach().double().contiguous().numpy() for part in parts)
    return position, velocity, rotation, rate

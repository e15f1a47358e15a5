"""Quadrotor: collective thrust along the body's z axis and three torques.

Notation: m mass, J inertia, g gravity, f thrust, tau torque, e3 the z axis; p, v, R, w as in robots/state.py.
Dynamics, explicit Euler on the manifold with step dt:

    p_{t+1} = p_t + v_t dt                    v_{t+1} = v_t + (R_t e3 f_t / m + g) dt
    R_{t+1} = R_t Exp(w_t dt)                 w_{t+1} = w_t + J^-1 (tau_t - w_t x J w_t) dt

Discrete differential flatness (Mellinger and Kumar, "Minimum snap trajectory generation and control for quadrotors",
2011, made discrete): read backwards, the dynamics give every state and action from positions and yaws alone,

    v_t = (p_{t+1} - p_t) / dt                R_t e3 f_t / m = (v_{t+1} - v_t) / dt - g
    w_t = Log(R_t' R_{t+1}) / dt              tau_t = J (w_{t+1} - w_t) / dt + w_t x J w_t

With N steps between fixed full states, p_0, p_1, R_0, R_1 follow from the start; p_N, p_{N+1}, R_N, w_N from the
goal. While R_0 and R_1 are fixed the robot only chooses its thrust: f_0 and f_1 give p_2 and p_3. What is left is
free:

    free = (f_0, f_1, p_4 .. p_{N-1}, yaw_2 .. yaw_{N-1}),  2 + 3 (N - 4) + (N - 2) numbers

`QuadrotorMap` is the same map compiled; `dynamics_kernels` are the dynamics.
"""

import math
from typing import final

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import so3
from nerfnav.robots.flat_map import FlatMap
from nerfnav.robots.kernels import quadrotor as kernels
from nerfnav.robots.kernels import quadrotor_dynamics as dynamics_kernels
from nerfnav.robots.quadrotor_config import QuadrotorConfig
from nerfnav.robots.robot import TYPICAL_MOVE, TYPICAL_TURN, Robot, length, penalty, speed
from nerfnav.robots.state import Motion, RigidState
from nerfnav.robots.thrust import Wish, shortened, thrust_and_attitude, tipped, upward


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
        """Return ends, attitudes, constants and bounds, as the kernels take them."""
        return self._ends, self._attitudes, self._constants, self._bounds

    def forward(self, free: np.ndarray) -> None:
        """Implement FlatMap with compiled kernels."""
        self._free, self._penalised = free, False
        kernels.motion(
            free, self._ends, self._attitudes, self._constants, self._beyond, self.velocity, self.rotation,
            self.rate, self.action,
        )  # fmt: skip

    def limits(self, weight: float) -> float:
        """Implement FlatMap with compiled kernels."""
        self._penalised = True
        self._clear_slopes()
        return kernels.limits(
            self.velocity, self.rotation, self.rate, self.action, self._bounds, weight, self.dt, *self._slopes
        )

    def backward(self, by_position: np.ndarray, by_rotation: np.ndarray, by_action: np.ndarray) -> np.ndarray:
        """Implement FlatMap with compiled kernels."""
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


def _constants_of(config: QuadrotorConfig, dt: float) -> np.ndarray:
    """Pack mass, inertia, gravity and time step for the kernels."""
    return np.array([config.mass, *config.inertia, config.gravity, dt])


def _arrays_of(state: RigidState) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Unpack position, velocity, attitude and body rate of one state for the kernels."""
    parts = (state.position, state.velocity, state.rotation, state.body_rate)
    position, velocity, rotation, rate = (part.detach().double().contiguous().numpy() for part in parts)
    return position, velocity, rotation, rate

_ACCELERATION = 4.0
"""Acceleration that durations count on [m/s^2]."""



class Quadrotor(Robot):
    """A flying body with four numbers to choose: thrust [N] and torque [N m]."""

    action_names = ("thrust_n", "torque_x_nm", "torque_y_nm", "torque_z_nm")
    minimum_steps = 4
    acceleration = _ACCELERATION

    def __init__(self, config: QuadrotorConfig | None = None) -> None:
        """A quadrotor with the given constants (default: those of QuadrotorConfig)."""
        self.config = QuadrotorConfig() if config is None else config
        self.name = self.config.name
        self.body = self.config.body
        self.weight = self.config.weight
        torques = (edge * self.config.angular_acceleration for edge in self.config.inertia)
        self.action_weights = (self.weight**-2, *(torque**-2 for torque in torques))
        self.bounds = self.config.bounds

    @property
    def deceleration(self) -> float:
        """Smallest deceleration over all directions by the limits of thrust and tilt, at most that of durations
        [m/s^2]."""
        config = self.config
        upward, downward = config.max_thrust / config.mass - config.gravity, (1 - config.thrust_floor) * config.gravity
        return min(_ACCELERATION, upward, downward, config.gravity * math.tan(config.max_tilt))

    def step(self, state: RigidState, action: Float[Tensor, "*batch 4"], dt: float) -> RigidState:
        """Compute the state after `dt` [s] under (thrust [N], torque [N m]), which is held meanwhile."""
        inertia = torch.tensor(self.config.inertia).to(action)
        thrust, torque = action[..., :1], action[..., 1:]
        acceleration = state.rotation[..., 2] * thrust / self.config.mass + self._gravity(action)
        gyroscopic = torch.linalg.cross(state.body_rate, inertia * state.body_rate)
        return RigidState(
            state.position + state.velocity * dt,
            state.velocity + acceleration * dt,
            so3.retract(state.rotation, state.body_rate * dt),
            state.body_rate + (torque - gyroscopic) / inertia * dt,
        )

    def hold(self, state: RigidState, dt: float, turn: float = 0.0) -> Float[Tensor, "4"]:
        """Brake, level out and hover."""
        config, least = self.config, self.config.thrust_floor * self.weight
        soon = so3.retract(state.rotation, state.body_rate * dt)
        turned = so3.from_yaw(torch.tensor(turn * dt / config.levelling).to(soon))

        def wish(at: RigidState, _: int) -> tuple[Tensor, Tensor]:
            brake = shortened(-config.braking * at.velocity, config.max_braking)
            force = upward(config.mass * (brake - self._gravity(brake)), least)
            return force, tipped(soon, force) @ turned

        return self.steer(state, wish, dt, config.levelling)

    def steer(self, state: RigidState, wish: Wish, dt: float, turn: float) -> Float[Tensor, "4"]:
        """Compute the thrust [N] and torque [N m] that come nearest to a wish.

        Explicit Euler carries an action's torque into the attitude two steps later. So the error of the attitude is
        that of the predictions for that time, and the torque is the one that takes the share `turn` of it away.
        """
        states, thrusts, still = [state], [], torch.zeros(3)
        for ahead in range(2):
            force, _ = wish(states[-1], ahead)
            thrusts.append((force @ states[-1].rotation[:, 2]).clamp_min(0)[None])  # never downward
            states.append(self.step(states[-1], torch.cat([thrusts[-1], still]), dt))  # torque: of the rate alone
        _, aim = wish(states[2], 2)
        rate = turn * so3.local(states[1].rotation, aim) / dt
        inertia = torch.tensor(self.config.inertia).to(rate)
        gyroscopic = torch.linalg.cross(state.body_rate, inertia * state.body_rate)
        return torch.cat([thrusts[0], inertia * (rate - state.body_rate) / dt + gyroscopic])

    def free_numbers(self, steps: int) -> int:
        """Count the free numbers over `steps` steps."""
        if steps < self.minimum_steps:
            raise InvalidInputError(
                f"a quadrotor needs at least {self.minimum_steps} steps between two full states, not {steps}"
            )
        return 2 + 3 * (steps - 4) + (steps - 2)

    def motion(
        self, free: Float[Tensor, "*batch k"], start: RigidState, goal: RigidState, steps: int, dt: float
    ) -> Motion:
        """Apply the flatness map above. The ends are met exactly, and the dynamics up to rounding.

        Finite with finite derivatives everywhere. No continuous map turns an acceleration into a direction all the
        way to zero (it would retract a ball to its sphere), so below 1e-4 m/s^2 of thrust the body stands upright.
        """
        expected = self.free_numbers(steps)
        if free.shape[-1] != expected:
            raise InvalidInputError(f"{steps} steps have {expected} free numbers, not {free.shape[-1]}")
        batch = free.shape[:-1]
        held = start.rotation, so3.retract(start.rotation, start.body_rate * dt)  # R_0 and R_1
        positions = self._positions(free, held, start, goal, dt)
        velocity = torch.cat(
            [_rows(start.velocity, batch), positions.diff(dim=-2)[..., 1:-1, :] / dt, _rows(goal.velocity, batch)], -2
        )
        pull = velocity[..., 2:, :].diff(dim=-2) / dt - self._gravity(free)  # what thrust must give, t = 2 .. N-1
        thrust, attitude = thrust_and_attitude(pull, free[..., -(steps - 2) :])
        first, second, last = (fixed.expand(*batch, 1, 3, 3) for fixed in (*held, goal.rotation))
        rotation = torch.cat([first, second, attitude, last], -3)
        between = so3.local(rotation[..., 1:-1, :, :], rotation[..., 2:, :, :]) / dt
        rate = torch.cat([_rows(start.body_rate, batch), between, _rows(goal.body_rate, batch)], -2)
        forces = torch.cat([free[..., :2], self.config.mass * thrust], -1)
        actions = torch.cat([forces[..., None], self._torques(rate, dt)], -1)
        return Motion(RigidState(positions[..., :-1, :], velocity, rotation, rate), actions, dt)

    def compiled_map(self, start: RigidState, goal: RigidState, steps: int, dt: float) -> QuadrotorMap | None:
        """See Robot; None for a robot that was given other bounds or another weight than those of its config."""
        as_configured = (self.bounds, self.weight) == (self.config.bounds, self.config.weight)
        return QuadrotorMap(self.config, start, goal, steps, dt) if as_configured else None

    def compiled_roll_out(
        self, start: RigidState, actions: Float[Tensor, "n 4"], dt: float
    ) -> Float[Tensor, "times 3"] | None:
        """See Robot; None for a robot that steps otherwise."""
        if type(self).step is not Quadrotor.step:
            return None
        positions = np.empty((len(actions) + 1, 3))
        dynamics_kernels.roll_out(
            _arrays_of(start), actions.double().numpy(), _constants_of(self.config, dt), positions
        )
        return torch.from_numpy(positions).to(actions)

    def compiled_hold(
        self, start: RigidState, wanted: Float[Tensor, "n 3"], dt: float, rest: float
    ) -> Motion | None:
        """See Robot; None for a robot that steps or holds otherwise."""
        kind, config, most = type(self), self.config, len(wanted)
        if (kind.step, kind.hold, kind.steer) != (Quadrotor.step, Quadrotor.hold, Quadrotor.steer):
            return None
        states = (np.empty((most + 1, 3)), np.empty((most + 1, 3)), np.empty((most + 1, 3, 3)), np.empty((most + 1, 3)))
        holding = np.array((config.braking, config.max_braking, config.levelling, config.thrust_floor * config.weight))
        actions = np.empty((most, 4))
        steps = dynamics_kernels.hold_out(
            _arrays_of(start), wanted.double().numpy(), _constants_of(config, dt), holding, rest, states, actions
        )
        moved = RigidState(*(torch.from_numpy(part[: steps + 1]).to(start.position) for part in states))
        return Motion(moved, torch.from_numpy(actions[:steps]).to(start.position), dt)

    def encode(
        self, waypoints: Float[Tensor, "times 4"], start: RigidState, goal: RigidState, dt: float
    ) -> Float[Tensor, " k"]:
        """Encode waypoints as free numbers: inner positions and yaws as they are, f_0 and f_1 by projection.

        f_0 and f_1 push along a fixed axis only: they get the part of the wished acceleration along it, and at least
        the thrust floor.
        """
        steps = waypoints.shape[0] - 1
        self.free_numbers(steps)
        floor, wanted = self.config.thrust_floor * self.weight, waypoints[2:4, :3].double().numpy()
        thrusts = np.empty(2)
        dynamics_kernels.first_thrusts(_arrays_of(start), wanted, _constants_of(self.config, dt), floor, thrusts)
        inner = waypoints[4:-1, :3].flatten()
        return torch.cat([torch.from_numpy(thrusts).to(inner), inner, waypoints[2:-1, 3]])

    def free_scales(self, free: Float[Tensor, " k"]) -> Float[Tensor, " k"]:
        """Return the weight, a few body lengths and half a radian."""
        scales = torch.full_like(free, TYPICAL_MOVE)
        scales[:2], scales[self.free_headings(len(free))] = self.weight, TYPICAL_TURN
        return scales

    def free_headings(self, count: int) -> slice:
        """Return the slice of the last ones, N - 2 of 4 (N - 3)."""
        return slice(count - (count + 4) // 4, count)

    def demands(self, motion: Motion) -> dict[str, Float[Tensor, "*batch times"]]:
        """Compute thrust [N], tilt [rad], speed [m/s] and the length of the body rate [rad/s]."""
        up = motion.states.rotation[..., 2]
        return {
            "thrust": motion.actions[..., 0],
            "tilt": torch.atan2(length(up[..., :2]), up[..., 2]),
            "speed": speed(motion),
            "body rate": length(motion.states.body_rate),
        }

    def limits(self, motion: Motion) -> Float[Tensor, "*batch"]:
        """Sum the squared shortfall of the upward thrust below its floor, in shares of the weight, and excess over
        bounds."""
        upward = motion.actions[..., 0] * motion.states.rotation[..., :-1, 2, 2] / self.weight
        return (self.config.thrust_floor - upward).clamp_min(0).square().sum(-1) + penalty(self, motion)

    def _gravity(self, like: Tensor) -> Tensor:
        return like.new_tensor([0.0, 0.0, -self.config.gravity])

    def _positions(
        self, free: Tensor, held: tuple[Tensor, Tensor], start: RigidState, goal: RigidState, dt: float
    ) -> Tensor:
        """p_0 .. p_{N+1}, where the last is virtual: one step beyond the goal."""
        batch = free.shape[:-1]
        axes = torch.stack([rotation[..., 2] for rotation in held], -2)
        pushed = axes * (free[..., :2, None] / self.config.mass) + self._gravity(free)
        first = start.position + start.velocity * dt
        second = first + (start.velocity + pushed[..., 0, :] * dt) * dt
        third = 2 * second - first + pushed[..., 1, :] * dt**2
        inner = free.shape[-1] // 4 - 1  # N - 4, as there are 4 (N - 3) free numbers
        middle = free[..., 2 : 2 + 3 * inner].unflatten(-1, (inner, 3))
        fixed = (start.position, first, second, third, goal.position, goal.position + goal.velocity * dt)
        rows = [_rows(position, batch) for position in fixed]
        return torch.cat([*rows[:4], middle, *rows[4:]], -2)

    def _torques(self, rate: Tensor, dt: float) -> Tensor:
        inertia = torch.tensor(self.config.inertia).to(rate)
        now = rate[..., :-1, :]
        return inertia * rate.diff(dim=-2) / dt + torch.linalg.cross(now, inertia * now)


def _rows(vector: Tensor, batch: torch.Size) -> Tensor:
    """A vector as one row of a (batch, time, ...) table."""
    return vector.expand(*batch, vector.shape[-1])[..., None, :]

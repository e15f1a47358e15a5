"""The quadrotor: collective thrust along the body's z axis and three torques.

Notation: m mass, J inertia, g gravity, f thrust, tau torque, e3 the z axis; p, v, R, w as in robots/state.py.
Dynamics, explicit Euler on the manifold with step dt:

    p_{t+1} = p_t + v_t dt                    v_{t+1} = v_t + (R_t e3 f_t / m + g) dt
    R_{t+1} = R_t Exp(w_t dt)                 w_{t+1} = w_t + J^-1 (tau_t - w_t x J w_t) dt

Discrete differential flatness (Mellinger and Kumar, "Minimum snap trajectory generation and control for quadrotors",
2011, made discrete): read backwards, the dynamics give every state and action from positions and yaws alone,

    v_t = (p_{t+1} - p_t) / dt                R_t e3 f_t / m = (v_{t+1} - v_t) / dt - g
    w_t = Log(R_t' R_{t+1}) / dt              tau_t = J (w_{t+1} - w_t) / dt + w_t x J w_t

With N steps between fixed full states, p_0, p_1, R_0, R_1 follow from the start; p_N, p_{N+1}, R_N, w_N from the goal.
While R_0 and R_1 are fixed the robot only chooses its thrust: f_0 and f_1 give p_2 and p_3. What is left is free:

    free = (f_0, f_1, p_4 .. p_{N-1}, yaw_2 .. yaw_{N-1}),  2 + 3 (N - 4) + (N - 2) numbers
"""

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import so3
from nerfnav.robots.limits import length, penalty, speed
from nerfnav.robots.quadrotor_config import QuadrotorConfig
from nerfnav.robots.quadrotor_map import QuadrotorMap, first_thrusts, held, way
from nerfnav.robots.robot import Robot
from nerfnav.robots.state import Motion, RigidState
from nerfnav.robots.thrust import Wish, shortened, thrust_and_attitude, tipped, upward

_FREE_POSITION, _FREE_YAW = 0.15, 0.5
"""How far a waypoint [m] and a heading [rad] may move before the motion is quite another one."""


class Quadrotor(Robot):
    """A flying body with four numbers to choose: thrust [N] and torque [N m]."""

    action_names = ("thrust_n", "torque_x_nm", "torque_y_nm", "torque_z_nm")
    minimum_steps = 4
    acceleration = 4.0

    def __init__(self, config: QuadrotorConfig | None = None) -> None:
        """A quadrotor with the given constants (default: those of QuadrotorConfig)."""
        self.config = QuadrotorConfig() if config is None else config
        self.name = self.config.name
        self.body = self.config.body
        self.weight = self.config.weight
        torques = (edge * self.config.angular_acceleration for edge in self.config.inertia)
        self.action_weights = (self.weight**-2, *(torque**-2 for torque in torques))
        self.bounds = self.config.bounds

    def step(self, state: RigidState, action: Float[Tensor, "*batch 4"], dt: float) -> RigidState:
        """The state after `dt` [s] under (thrust [N], torque [N m]), which is held meanwhile."""
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
        """The thrust [N] and torque [N m] that come nearest to a wish.

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
        """How many numbers are free over `steps` steps."""
        if steps < self.minimum_steps:
            raise InvalidInputError(
                f"a quadrotor needs at least {self.minimum_steps} steps between two full states, not {steps}"
            )
        return 2 + 3 * (steps - 4) + (steps - 2)

    def motion(
        self, free: Float[Tensor, "*batch k"], start: RigidState, goal: RigidState, steps: int, dt: float
    ) -> Motion:
        """The flatness map above. The ends are met exactly, and the dynamics up to rounding.

        Finite with finite derivatives everywhere. No continuous map turns an acceleration into a direction all the
        way to zero (it would retract a ball to its sphere), so below 1e-4 m/s^2 of thrust the body stands upright.
        """
        expected = self.free_numbers(steps)
        if free.shape[-1] != expected:
            raise InvalidInputError(f"{steps} steps have {expected} free numbers, not {free.shape[-1]}")
        batch = free.shape[:-1]
        held = self._fixed_attitudes(start, dt)
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
        known = (self.bounds, self.weight) == (self.config.bounds, self.config.weight)
        return QuadrotorMap(self.config, start, goal, steps, dt) if known else None

    def compiled_way(
        self, start: RigidState, actions: Float[Tensor, "n 4"], dt: float
    ) -> Float[Tensor, "times 3"] | None:
        """See Robot; None for a robot that steps otherwise."""
        if type(self).step is not Quadrotor.step:
            return None
        return torch.from_numpy(way(self.config, start, actions.double().numpy(), dt)).to(actions)

    def compiled_hold(
        self, start: RigidState, wanted: Float[Tensor, "n 3"], dt: float, rest: float
    ) -> Motion | None:
        """See Robot; None for a robot that steps or holds otherwise."""
        kind = type(self)
        if (kind.step, kind.hold, kind.steer) != (Quadrotor.step, Quadrotor.hold, Quadrotor.steer):
            return None
        return held(self.config, start, wanted, dt, rest)

    def encode(
        self, waypoints: Float[Tensor, "times 4"], start: RigidState, goal: RigidState, dt: float
    ) -> Float[Tensor, " k"]:
        """Free numbers near waypoints: inner positions and yaws as they are, f_0 and f_1 by projection.

        f_0 and f_1 push along a fixed axis only: they get the part of the wished acceleration along it, and at least
        the thrust floor.
        """
        steps = waypoints.shape[0] - 1
        self.free_numbers(steps)
        floor, wanted = self.config.thrust_floor * self.weight, waypoints[2:4, :3].double().numpy()
        thrusts = first_thrusts(self.config, start, wanted, dt, floor)
        inner = waypoints[4:-1, :3].flatten()
        return torch.cat([torch.from_numpy(thrusts).to(inner), inner, waypoints[2:-1, 3]])

    def free_scales(self, free: Float[Tensor, " k"]) -> Float[Tensor, " k"]:
        """The weight, a few body lengths, half a radian."""
        scales = torch.full_like(free, _FREE_POSITION)
        scales[:2], scales[self.free_headings(len(free))] = self.weight, _FREE_YAW
        return scales

    def free_headings(self, count: int) -> slice:
        """The last ones."""
        steps = (count + 12) // 4
        return slice(count - (steps - 2), count)

    def demands(self, motion: Motion) -> dict[str, Float[Tensor, "*batch times"]]:
        """Thrust [N], tilt [rad], speed [m/s], length of the body rate [rad/s]."""
        up = motion.states.rotation[..., 2]
        return {
            "thrust": motion.actions[..., 0],
            "tilt": torch.atan2(length(up[..., :2]), up[..., 2]),
            "speed": speed(motion),
            "body rate": length(motion.states.body_rate),
        }

    def limits(self, motion: Motion) -> Float[Tensor, "*batch"]:
        """Squared shortfall of the upward thrust below its floor, in shares of the weight, and excess over bounds."""
        upward = motion.actions[..., 0] * motion.states.rotation[..., :-1, 2, 2] / self.weight
        return (self.config.thrust_floor - upward).clamp_min(0).square().sum(-1) + penalty(self, motion)

    def _gravity(self, like: Tensor) -> Tensor:
        return like.new_tensor([0.0, 0.0, -self.config.gravity])

    @staticmethod
    def _fixed_attitudes(start: RigidState, dt: float) -> tuple[Tensor, Tensor]:
        """R_0 and R_1."""
        return start.rotation, so3.retract(start.rotation, start.body_rate * dt)

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
        fixed = [start.position, first, second, third]
        ends = [goal.position, goal.position + goal.velocity * dt]
        return torch.cat([*(_rows(p, batch) for p in fixed), middle, *(_rows(p, batch) for p in ends)], -2)

    def _torques(self, rate: Tensor, dt: float) -> Tensor:
        inertia = torch.tensor(self.config.inertia).to(rate)
        now = rate[..., :-1, :]
        return inertia * rate.diff(dim=-2) / dt + torch.linalg.cross(now, inertia * now)


def _rows(vector: Tensor, batch: torch.Size) -> Tensor:
    """A vector as one row of a (batch, time, ...) table."""
    return vector.expand(*batch, vector.shape[-1])[..., None, :]

"""The couch: a long box on the ground that can be pushed in any direction and turned at will.

Notation: m mass, J inertia about z, F force in the plane of the world, tau torque about z; p, v, R, w as in
robots/state.py, psi the heading. Dynamics, explicit Euler with step dt, as for the quadrotor:

    p_{t+1} = p_t + v_t dt        v_{t+1} = v_t + F_t / m dt
    psi_{t+1} = psi_t + w_t dt    w_{t+1} = w_t + tau_t / J dt

All of it is linear, so positions and headings alone give every state and action. With N steps between fixed full
states the first two poses follow from the start, the last one and the last velocities from the goal. Free are

    free = (x_2, y_2, .. x_{N-1}, y_{N-1}, psi_2 .. psi_{N-1}),  3 (N - 2) numbers
"""


import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import so3
from nerfnav.robots.couch_config import CouchConfig
from nerfnav.robots.couch_map import CouchMap
from nerfnav.robots.ground import about_z, check_ground_ends, heading, on_the_ground, row, spatial, wrapped
from nerfnav.robots.limits import length, penalty, speed
from nerfnav.robots.robot import Robot
from nerfnav.robots.state import Motion, RigidState
from nerfnav.robots.thrust import shortened

_FREE_POSITION, _FREE_YAW = 0.15, 0.5
"""How far a waypoint [m] and a heading [rad] may move before the motion is quite another one."""


class Couch(Robot):
    """A ground robot with three numbers to choose: force [N] along the world's x and y, torque [N m]."""

    action_names = ("force_x_n", "force_y_n", "torque_z_nm")
    minimum_steps = 3
    planar = True

    def __init__(self, config: CouchConfig | None = None) -> None:
        """A couch with the given constants (default: those of CouchConfig)."""
        self.config = config = CouchConfig() if config is None else config
        self.name = config.name
        self.body = config.body
        torque = config.inertia * config.max_force / config.mass / (0.5 * config.extents[0])
        self.action_weights = (config.max_force**-2, config.max_force**-2, torque**-2)
        self.bounds = config.bounds

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
        """How many numbers are free over `steps` steps."""
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
        turning = wrapped(yaw[..., 2:] - yaw[..., 1:-1]) / dt
        yaw_rate = torch.cat([row(rate, batch), turning, row(goal.body_rate[..., 2], batch)], -1)
        force = self.config.mass * velocity.diff(dim=-2) / dt
        torque = self.config.inertia * yaw_rate.diff(dim=-1) / dt
        states = RigidState(
            spatial(position, start.position[..., 2]), spatial(velocity, 0.0), so3.from_yaw(yaw), about_z(yaw_rate)
        )
        return Motion(states, torch.cat([force, torque[..., None]], -1), dt)

    def compiled_map(self, start: RigidState, goal: RigidState, steps: int, dt: float) -> CouchMap | None:
        """See Robot; None for a robot that was given other bounds than those of its config."""
        known = self.bounds == self.config.bounds
        return CouchMap(self.config, start, goal, steps, dt) if known else None

    def encode(
        self, waypoints: Float[Tensor, "times 4"], start: RigidState, goal: RigidState, dt: float
    ) -> Float[Tensor, " k"]:
        """The inner waypoints and headings as they are."""
        self.free_numbers(waypoints.shape[0] - 1)
        return torch.cat([waypoints[2:-1, :2].flatten(), waypoints[2:-1, 3]])

    def free_scales(self, free: Float[Tensor, " k"]) -> Float[Tensor, " k"]:
        """A few body widths, half a radian."""
        scales = torch.full_like(free, _FREE_POSITION)
        scales[2 * free.shape[-1] // 3 :] = _FREE_YAW
        return scales

    def demands(self, motion: Motion) -> dict[str, Float[Tensor, "*batch times"]]:
        """Speed [m/s], yaw rate [rad/s], force [N]."""
        return {
            "speed": speed(motion),
            "yaw rate": motion.states.body_rate[..., 2],
            "force": length(motion.actions[..., :2]),
        }

    def limits(self, motion: Motion) -> Float[Tensor, "*batch"]:
        """Squared excess over the bounds."""
        return penalty(self, motion)

    def settled(self, state: RigidState, before: RigidState) -> RigidState:
        """Level, and at the height that it had."""
        return on_the_ground(state, before)

    def check_ends(self, start: RigidState, goal: RigidState) -> None:
        """Both ends must be level and at one height."""
        check_ground_ends(self.name, start, goal)

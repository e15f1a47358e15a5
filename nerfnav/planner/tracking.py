"""Following a path with a geometric controller on SO(3), in the discrete time of the simulated quadrotor.

After Mellinger and Kumar (2011) and Lee, Leok and McClamroch, "Geometric tracking control of a quadrotor UAV on
SE(3)" (2010):

    F = m (a_ref + w^2 (p_ref - p) + 2 z w (v_ref - v) - g)     the force that is wanted
    f = F . R e3                                                what the present attitude gives of it
    R_des from F and the heading,  e_R = Log(R' R_des)

The explicit Euler dynamics carry an action's torque into the attitude two steps later, so the attitude error is
taken between the predictions for that time, and the torque is the one that takes the share `turn` of it away.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.geometry import so3
from nerfnav.robots.quadrotor import Quadrotor
from nerfnav.robots.state import Motion, RigidState


@dataclass(frozen=True)
class TrackingConfig:
    """How stiffly a reference is followed."""

    frequency: float = 4.0
    """w: natural frequency of the position error [rad/s]; with steps of 0.1 s, more than about 5 rings."""
    damping: float = 1.0
    """z: 1 is critical."""
    turn: float = 0.8
    """Share of the attitude error that is taken away in one step."""
    least_thrust: float = 0.3
    """Upward part of the wanted force at least, as a share of the weight: the robot does not turn over."""


@dataclass(frozen=True)
class Reference:
    """Where a robot shall be at times 0, dt, .. N dt and a few beyond."""

    position: Float[Tensor, "times 3"]
    """[m]"""
    yaw: Float[Tensor, " times"]
    """[rad]"""
    dt: float
    """[s]"""

    def at(self, step: int) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Position, velocity and acceleration as the Euler steps have them, and heading; at rest beyond the end."""
        now, soon, later = (self.position[min(step + k, len(self.position) - 1)] for k in range(3))
        velocity, next_velocity = (soon - now) / self.dt, (later - soon) / self.dt
        return now, velocity, (next_velocity - velocity) / self.dt, self.yaw[min(step, len(self.yaw) - 1)]


def track(
    robot: Quadrotor, start: RigidState, reference: Reference, steps: int, config: TrackingConfig | None = None
) -> Motion:
    """The motion over `steps` steps of a robot that starts at `start` and follows `reference` as well as it can."""
    config = TrackingConfig() if config is None else config
    states, actions = [start], []
    for step in range(steps):
        actions.append(control(robot, states[-1], reference, step, config))
        states.append(robot.step(states[-1], actions[-1], reference.dt))
    return Motion(RigidState.stack(states), torch.stack(actions), reference.dt)


def control(
    robot: Quadrotor, state: RigidState, reference: Reference, step: int, config: TrackingConfig
) -> Float[Tensor, "4"]:
    """Thrust [N] and torque [N m] at a time step."""
    dt, inertia = reference.dt, torch.tensor(robot.config.inertia)
    thrust, still = _thrust(robot, state, reference, step, config), torch.zeros(3)
    soon = robot.step(state, torch.cat([thrust, still]), dt)  # the torque changes nothing but its body rate
    push = torch.cat([_thrust(robot, soon, reference, step + 1, config), still])
    later = robot.step(soon, push, dt)
    wanted = wanted_force(robot, later, reference, step + 2, config)
    aim = attitude_for(wanted, reference.at(step + 2)[3])
    rate = config.turn * so3.local(soon.rotation, aim) / dt
    gyroscopic = torch.linalg.cross(state.body_rate, inertia * state.body_rate)
    return torch.cat([thrust, inertia * (rate - state.body_rate) / dt + gyroscopic])


def wanted_force(
    robot: Quadrotor, state: RigidState, reference: Reference, step: int, config: TrackingConfig
) -> Float[Tensor, "3"]:
    """F [N], kept upward."""
    position, velocity, acceleration, _ = reference.at(step)
    pull = config.frequency**2 * (position - state.position)
    brake = 2 * config.damping * config.frequency * (velocity - state.velocity)
    force = robot.config.mass * (acceleration + pull + brake)
    upward = (force[2] + robot.weight).clamp_min(config.least_thrust * robot.weight)
    return torch.stack([force[0], force[1], upward])


def attitude_for(force: Float[Tensor, "3"], yaw: Float[Tensor, ""]) -> Float[Tensor, "3 3"]:
    """The attitude whose z axis points along a force that is not level, and whose x axis heads for `yaw` [rad]."""
    up = force / force.norm()
    ahead = torch.stack([torch.cos(yaw), torch.sin(yaw), torch.zeros_like(yaw)])
    left = torch.linalg.cross(up, ahead)
    left = left / left.norm()
    return torch.stack([torch.linalg.cross(left, up), left, up], -1)


def _thrust(
    robot: Quadrotor, state: RigidState, reference: Reference, step: int, config: TrackingConfig
) -> Float[Tensor, "1"]:
    """f [N]: the part of the wanted force along the body's z axis, never downward."""
    along = wanted_force(robot, state, reference, step, config) @ state.rotation[:, 2]
    return along.clamp_min(0)[None]

"""Geometric controller on SO(3): follow a path in the discrete time of the simulated quadrotor.

After Mellinger and Kumar (2011) and Lee, Leok and McClamroch, "Geometric tracking control of a quadrotor UAV on
SE(3)" (2010):

    F = m (a_ref + w^2 (p_ref - p) + 2 z w (v_ref - v) - g)     wanted force
    f = F . R e3                                                thrust: its part along the present attitude
    R_des from F and the heading,  e_R = Log(R' R_des)

`Quadrotor.steer` converts force and attitude to thrust and torque.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.robots import Motion, Quadrotor, RigidState
from nerfnav.robots.thrust import upward


@dataclass(frozen=True)
class TrackingConfig:
    """Gains of the controller."""

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
    """Reference: position and heading at times 0, dt, .. N dt and a few beyond."""

    position: Float[Tensor, "times 3"]
    """[m]"""
    yaw: Float[Tensor, " times"]
    """[rad]"""
    dt: float
    """[s]"""

    def at(self, step: int) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Return position, velocity and acceleration as the Euler steps have them, and heading; at rest beyond the
        end."""
        now, soon, later = (self.position[min(step + k, len(self.position) - 1)] for k in range(3))
        velocity, next_velocity = (soon - now) / self.dt, (later - soon) / self.dt
        return now, velocity, (next_velocity - velocity) / self.dt, self.yaw[min(step, len(self.yaw) - 1)]


def track(
    robot: Quadrotor, start: RigidState, reference: Reference, steps: int, config: TrackingConfig | None = None
) -> Motion:
    """Roll out `steps` steps of a robot that starts at `start` and follows `reference` as well as it can."""
    config = TrackingConfig() if config is None else config
    states, actions = [start], []
    for step in range(steps):
        actions.append(control(robot, states[-1], reference, step, config))
        states.append(robot.step(states[-1], actions[-1], reference.dt))
    return Motion(RigidState.stack(states), torch.stack(actions), reference.dt)


def control(
    robot: Quadrotor, state: RigidState, reference: Reference, step: int, config: TrackingConfig
) -> Float[Tensor, "4"]:
    """Compute thrust [N] and torque [N m] at a time step."""

    def wish(at: RigidState, ahead: int) -> tuple[Tensor, Tensor]:
        force = wanted_force(robot, at, reference, step + ahead, config)
        return force, attitude_for(force, reference.at(step + ahead)[3])

    return robot.steer(state, wish, reference.dt, config.turn)


def wanted_force(
    robot: Quadrotor, state: RigidState, reference: Reference, step: int, config: TrackingConfig
) -> Float[Tensor, "3"]:
    """Compute F [N], kept upward."""
    position, velocity, acceleration, _ = reference.at(step)
    pull = config.frequency**2 * (position - state.position)
    brake = 2 * config.damping * config.frequency * (velocity - state.velocity)
    force = robot.config.mass * (acceleration + pull + brake)
    against_gravity = torch.tensor([0.0, 0.0, robot.weight])
    return upward(force + against_gravity, config.least_thrust * robot.weight)


def attitude_for(force: Float[Tensor, "3"], yaw: Float[Tensor, ""]) -> Float[Tensor, "3 3"]:
    """Return the attitude whose z axis points along a force that is not level, and whose x axis heads for `yaw`
    [rad]."""
    up = force / force.norm()
    ahead = torch.stack([torch.cos(yaw), torch.sin(yaw), torch.zeros_like(yaw)])
    left = torch.linalg.cross(up, ahead)
    left = left / left.norm()
    return torch.stack([torch.linalg.cross(left, up), left, up], -1)

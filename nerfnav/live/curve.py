"""Setpoints of a discrete motion: the uniform cubic B-spline of its positions.

A motion's velocity v_k leads from p_k to p_k+1: it is that of the time between the two. So a vehicle at p with velocity
v plans from `half_a_step_back`, p - v h / 2, and the motion's p_k belongs to the time t + (k - 1/2) h. With control
points p_k, continued by a constant acceleration before the first and by rest after the last, knot k has

    position (p_k-1 + 4 p_k + p_k+1) / 6,   velocity (p_k+1 - p_k-1) / 2 h,   acceleration (p_k-1 - 2 p_k + p_k+1) / h^2

and between knots the acceleration is linear: at the time t the curve has the vehicle's own velocity, and every setpoint
is the derivative of the one before it.
"""

from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.geometry import so3
from nerfnav.live.answer import Setpoint
from nerfnav.robots import Motion, RigidState, unwrapped


def half_a_step_back(state: RigidState, dt: float, leaning: RigidState | None = None) -> RigidState:
    """Where a motion in steps of `dt` [s] begins that is to pass through a state now.

    A motion's attitude R_k is that of its acceleration at knot k + 1, half a step from now: there the attitude and body
    rate are those of `leaning`, where that is known, or what the state's own lead to.
    """
    turned = so3.retract(state.rotation, 0.5 * dt * state.body_rate)
    back = state.position - 0.5 * dt * state.velocity
    if leaning is None:
        return replace(state, position=back, rotation=turned)
    return replace(state, position=back, rotation=leaning.rotation, body_rate=leaning.body_rate)


def knots(motion: Motion) -> Float[Tensor, "knots 3 3"]:
    """Position [m], velocity and acceleration at the knots, that of p_0 first; the last one is at rest."""
    points, h = motion.states.position.double(), motion.dt
    points = torch.cat([points, points[-1:], points[-1:]])
    points = torch.cat([3 * points[:1] - 3 * points[1:2] + points[2:3], points])
    before, here, after = points[:-2], points[1:-1], points[2:]
    values = (before + 4 * here + after) / 6, (after - before) / (2 * h), (before - 2 * here + after) / h**2
    return torch.stack(values, 1)


def on_curve(motion: Motion) -> Motion:
    """The motion as its setpoints have it, to be judged as the planner's own is."""
    return replace(motion, states=replace(motion.states, position=knots(motion)[:-1, 0].float()))


def setpoints_of(motion: Motion, time: float) -> tuple[Setpoint, ...]:
    """The motion of a plan that was made at a time [s] from `half_a_step_back`: then, and at each knot after it."""
    table, h = knots(motion), motion.dt
    yaws = unwrapped(so3.yaw_of(motion.states.rotation)).double().tolist()
    begun = (table[0] + table[1]) / 2  # of the acceleration; of the others below, by the cubic between the knots
    begun[0] = (table[0, 0] + table[1, 0]) / 2 - h**2 / 16 * (table[0, 2] + table[1, 2])
    begun[1] = (table[0, 1] + table[1, 1]) / 2 + h / 8 * (table[0, 2] - table[1, 2])
    rows = [(time, begun, yaws[0])]
    for index in range(1, len(table)):  # yaws are those of the times between the knots
        pair = yaws[min(index - 1, len(yaws) - 1)], yaws[min(index, len(yaws) - 1)]
        rows.append((time + (index - 0.5) * h, table[index], sum(pair) / 2))
    return tuple(_setpoint(when, values, yaw) for when, values, yaw in rows)


def _setpoint(time: float, values: Tensor, yaw: float) -> Setpoint:
    (x, y, z), (vx, vy, vz), (ax, ay, az) = values.tolist()
    return Setpoint(time, (x, y, z), (vx, vy, vz), (ax, ay, az), yaw)

"""Setpoints of a plan by a uniform cubic B-spline, and prediction of a vehicle that follows them.

A motion's velocity v_k leads from p_k to p_k+1: it is that of the time between the two. So a vehicle at p with
velocity v plans from `shift_half_step_back`, p - v h / 2, and the motion's p_k belongs to the time t + (k - 1/2) h.
With control points p_k, continued by a constant acceleration before the first and by rest after the last, the curve
has the vehicle's own velocity at the time t, and its acceleration is linear between knots: every setpoint is the
derivative of the one before it.

A vehicle that follows setpoints is predicted by constant velocities and what the setpoints change. Notation as in
robots/state.py. Over a step dt, with the action u = (dp, dv, dtheta, dw):

    p' = p + v dt + dp,   v' = v + dv,   R' = R Exp(w dt) Exp(dtheta),   w' = w + dw

`compute_guided_action` is the action of a vehicle that follows guidance: by how much that differs from constant
velocities. A vehicle that flies stands as its acceleration wants it: its z axis along a - g (Mellinger and Kumar,
2011). What the vehicle does besides is process noise.
"""

from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.geometry import so3
from nerfnav.live.answer import Guidance, Order, Setpoint
from nerfnav.planner import PiecewisePolynomial, uniform_cubic
from nerfnav.robots import TANGENT, HandHeld, Motion, RigidState, thrust_and_attitude, unwrap_angles


def shift_half_step_back(state: RigidState, dt: float, leaning: RigidState | None = None) -> RigidState:
    """Return the start of a motion in steps of `dt` [s] that is to pass through a state now.

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
    shape = _spline(motion)
    return _table(shape, shape.times[:-1])


def place_on_curve(motion: Motion) -> Motion:
    """Return the motion as its setpoints have it, to be judged as the planner's own is."""
    return replace(motion, states=replace(motion.states, position=knots(motion)[:-1, 0].float()))


def setpoints_of(motion: Motion, time: float) -> tuple[Setpoint, ...]:
    """The motion of a plan that was made at a time [s] from `shift_half_step_back`: then, and at each knot after it."""
    shape, begun = _spline(motion), 0.5 * motion.dt
    times = torch.cat([shape.times.new_tensor([begun]), shape.times[1:-1]])
    given = unwrap_angles(so3.yaw_of(motion.states.rotation)).double()
    given = torch.cat([given, given[-1:].expand(len(times) - len(given))])
    yaws = torch.cat([given[:1], (given[:-1] + given[1:]) / 2])  # given are those of the times between the knots
    rows = zip((time + (times - begun)).tolist(), _table(shape, times), yaws.tolist(), strict=True)
    return tuple(_setpoint(when, values, yaw) for when, values, yaw in rows)


def _spline(motion: Motion) -> PiecewisePolynomial:
    """Its time 0 is that of the knot of p_0; its last segment rests, from the last knot on."""
    points = motion.states.position.double()
    points = torch.cat([points, points[-1:].expand(3, -1)])
    return uniform_cubic(torch.cat([3 * points[:1] - 3 * points[1:2] + points[2:3], points]), motion.dt)


def _table(shape: PiecewisePolynomial, times: Float[Tensor, " n"]) -> Float[Tensor, "n 3 3"]:
    """Position, velocity and acceleration at times."""
    return torch.stack([shape(times, order) for order in range(3)], 1)


def _setpoint(time: float, values: Tensor, yaw: float) -> Setpoint:
    (x, y, z), (vx, vy, vz), (ax, ay, az) = values.tolist()
    return Setpoint(time, (x, y, z), (vx, vy, vz), (ax, ay, az), yaw)


_GRAVITY = 9.81
_INSTANT_S = 0.01
"""Over which body rates are taken."""


class GuidedVehicle(HandHeld):
    """Vehicle that follows setpoints."""

    action_names = tuple(f"{part}_{axis}" for part in ("dp", "dv", "dtheta", "dw") for axis in "xyz")
    action_weights = (1.0,) * TANGENT

    def step(self, state: RigidState, action: Float[Tensor, "*batch 12"], dt: float) -> RigidState:
        """The state after `dt` [s]."""
        return super().step(state, action[..., :0], dt).retract(action)

    def hold(self, state: RigidState, dt: float, turn: float = 0.0) -> Float[Tensor, "12"]:
        """Return the action of constant velocities."""
        return torch.zeros(TANGENT)


def compute_guided_action(
    guidance: Guidance | None, start: float, end: float, flies: bool
) -> Float[Tensor, "12"] | None:
    """Return the action of a vehicle that follows guidance from one time [s] to another; None where it follows none."""
    before, after = (predict_guided(guidance, time, flies) for time in (start, end))
    if before is None or after is None:
        return None
    return HandHeld().step(before, torch.zeros(0), end - start).local(after)


def predict_guided(guidance: Guidance | None, time: float, flies: bool) -> RigidState | None:
    """Return the state at a time [s] of a vehicle that follows guidance; None where there is none to follow."""
    if guidance is None or guidance.order not in (Order.FOLLOW, Order.BRAKE):
        return None
    point, later = guidance.at(time), guidance.at(time + _INSTANT_S)
    assert point is not None and later is not None, "what is to be followed has setpoints"
    here, there = _attitude(point, flies), _attitude(later, flies)
    rate = so3.local(here, there) / _INSTANT_S
    return RigidState(torch.tensor(point.position), torch.tensor(point.velocity), here, rate)


def _attitude(point: Setpoint, flies: bool) -> Float[Tensor, "3 3"]:
    yaw = torch.tensor(point.yaw)
    if not flies:
        return so3.from_yaw(yaw)
    pull = torch.tensor(point.acceleration) + torch.tensor([0.0, 0.0, _GRAVITY])
    return thrust_and_attitude(pull[None], yaw[None])[1][0]

"""Reference trajectory: what the controller tracks between the time steps of plans.

A plan's states obey explicit Euler steps: p_{k+1} = p_k + v_k h. Read as positions at times k h they are sound, and
v_k, R_k and w_k belong to later times (k + 1/2, k + 1 and k + 3/2 steps: central differences). So the reference is a
quintic B-spline of the positions and yaws of the plan and of those that were flown before it. It has continuous snap,
and its control points

    c_k = x_k - (x_{k-1} - 2 x_k + x_{k+1}) / 4

make it exact for cubic motions, without asking more of the thrust than the plan does where that alternates from
step to step, as splines through the waypoints would (quasi-interpolation: de Boor and Fix, 1973). Thrust, attitude,
body rate and its derivative follow by differential flatness (Mellinger and Kumar, "Minimum snap trajectory
generation and control for quadrotors", 2011).
"""

from dataclasses import dataclass, field

import numpy as np
import scipy
import torch

from nerfnav.geometry import so3
from nerfnav.robots import Motion, RigidState, thrust_and_attitude

_DEGREE, _PAST, _AHEAD = 5, 3, 4
"""Degree of the spline, and the waypoints before and after its start on which a step depends."""
_SAME_M = 0.01
"""Largest distance of a plan from the state to which the last one led that counts as its continuation [m]."""


@dataclass(frozen=True)
class ReferenceState:
    """Reference of the controller at one time."""

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    """Without gravity: the acceleration by thrust [m/s^2]."""
    rotation: np.ndarray
    body_rate: np.ndarray
    turning: np.ndarray
    """Angular acceleration [rad/s^2]."""


@dataclass(frozen=True)
class TrackedWaypoints:
    """Waypoints (x, y, z [m], yaw [rad]) that were tracked, and the state to which the last plan led."""

    waypoints: np.ndarray = field(default_factory=lambda: np.zeros((0, 4)))
    """One for each time step, the latest last."""
    led: RigidState | None = None
    """None before the first plan."""

    def track(self, plan: Motion, ticks: int, gravity: float) -> tuple[list[ReferenceState], "TrackedWaypoints"]:
        """Compute the reference at `ticks` times of a plan's first step, and the waypoints after it."""
        ahead, past = _waypoints(plan.states), self.waypoints
        if self.led is None or not (self.led.position - plan.states[0].position).norm() < _SAME_M:
            past = ahead[0] - np.arange(_PAST, 0, -1)[:, None] * (ahead[1] - ahead[0])  # straight back from the start
        ahead[:, 3] += 2 * np.pi * np.round((past[-1, 3] - ahead[0, 3]) / (2 * np.pi))
        reference = _flat(np.concatenate([past, ahead]), len(past), ticks, plan.dt, gravity)
        return reference, TrackedWaypoints(np.concatenate([past, ahead[:1]])[-_PAST:], plan.states[1])


def _waypoints(states: RigidState) -> np.ndarray:
    """Waypoints of a plan, continued at its last speed for as long as splines look ahead."""
    position = states.position.detach().double().numpy()[: _AHEAD + 1]
    yaw = np.unwrap(so3.yaw_of(states.rotation.detach()).double().numpy()[: _AHEAD + 1])
    known = np.concatenate([position, yaw[:, None]], -1)
    missing = np.arange(1, _AHEAD + 2 - len(known))[:, None]
    return np.concatenate([known, known[-1] + missing * (known[-1] - known[-2])])


def _flat(waypoints: np.ndarray, now: int, ticks: int, dt: float, gravity: float) -> list[ReferenceState]:
    """Differential flatness at `ticks` times of the step of `dt` [s] after waypoint `now`."""
    control = waypoints[1:-1] - 0.25 * np.diff(waypoints, 2, axis=0)
    knots = dt * (np.arange(len(control) + _DEGREE + 1) + 1 - (_DEGREE + 1) / 2)
    curve, tick = scipy.interpolate.BSpline(knots, control, _DEGREE), dt / ticks
    times = now * dt + tick * np.arange(-1, ticks + 2)
    at, velocity, acceleration = (curve(times, order) for order in range(3))
    pull = acceleration[:, :3] + (0.0, 0.0, gravity)
    _, rotation = thrust_and_attitude(torch.from_numpy(pull), torch.from_numpy(at[:, 3]))
    rate = (so3.local(rotation[:-1], rotation[1:]) / tick).numpy()  # in the middle between two times
    turning, rotations = np.diff(rate, axis=0) / tick, rotation.numpy()
    return [
        ReferenceState(at[i, :3], velocity[i, :3], pull[i], rotations[i], 0.5 * (rate[i - 1] + rate[i]), turning[i - 1])
        for i in range(1, ticks + 1)
    ]

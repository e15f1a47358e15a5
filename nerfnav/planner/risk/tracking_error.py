"""Tracking error covariance: how far noise takes a robot from its plan before any control can take it back.

    x_{t+1} = f(x_t, u_t) + w_t,  w ~ N(0, Q);   A = df/dx, B = df/du where it holds;   S covariance of an estimate

What a step's noise does shows in the picture at its end, and the action that answers it moves the position d steps
later, d being the relative degree: the least d with e' A^(d-1) B != 0 for the axis e. It is 2 for the height of a
quadrotor, whose thrust changes the velocity first, and 4 for its other axes: torque, rate, attitude, velocity, place.
The error that no controller can avoid is therefore that of predicting over d steps,

    P = A^d S A^d' + sum_{i < d} A^i Q A^i'

(minimum-variance control: Aastroem, "Introduction to Stochastic Control Theory", 1970, chapter 6). A loop that plans
again in each step has at least this error, and with it about this one: what lies farther ahead is planned again
before it comes, so that the error does not grow along the plan as it would in open loop. In the first steps it is
smaller, for noise has come but once, twice, ...: a robot that is off the middle of a strait right before it had
better not enter, while its height still obeys, and one that is in the middle had better do it now. With the paper's
noise the quadrotor's is 2.1, 2.9, 3.6 and then 4.2 cm to the sides, and 2.1 and then 2.9 cm in height.
"""

from dataclasses import dataclass
from functools import lru_cache

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.robots import POSITION, TANGENT, RigidState, Robot

_REACHES = 1e-9
"""Change of the position [m] by a unit of action that counts as none."""


@dataclass(frozen=True)
class NoiseModel:
    """What is expected to disturb a robot: standard deviations of position [m], velocity [m/s], attitude [rad] and body
    rate [rad/s], on each axis."""

    noise: tuple[float, float, float, float] = (0.02, 0.01, 0.02, 0.01)
    """Added by each time step; the paper's process noise."""
    estimate: tuple[float, float, float, float] = (0.005, 0.02, 0.005, 0.02)
    """Of the estimate that a plan starts from: as wide as flights by camera alone have it."""


PAPER_NOISE = NoiseModel()
"""What disturbs the robot in the paper."""


@dataclass(frozen=True)
class RiskContext:
    """What a plan is told of the flight that it is made for."""

    dt: float = 0.1
    """Length of a step [s]."""
    disturbance: NoiseModel = PAPER_NOISE
    """What will disturb it."""
    pace: float | None = None
    """Way of a step [m] on which risk counts once, for plans whose arrival is put off; None: once for each step."""
    height: float | None = None
    """At which a robot stays that never leaves it [m]."""


PAPER_RISK_CONTEXT = RiskContext()
"""Of a plan in the paper's steps and noise."""


@lru_cache(maxsize=32)
def tracking_deviations(robot: Robot, dt: float, disturbance: NoiseModel) -> tuple[tuple[float, float], ...]:
    """Standard deviations [m] of the position around a plan after its first steps, one by one, the last also after all
    later ones: level, on the worse of two axes, and in height.

    Axes that actions do not reach where the robot holds, such as a cart's to the side, count as reached in the fewest
    steps that the robot can plan.
    """
    by_state, reach = _linearised(robot, dt)
    noise, covariance = (_covariance(part) for part in (disturbance.noise, disturbance.estimate))
    variances, unreached = torch.zeros(3, dtype=torch.float64), torch.ones(3, dtype=torch.bool)
    spreads: list[tuple[float, float]] = []
    while unreached.any() and len(spreads) < robot.minimum_steps:
        covariance = by_state @ covariance @ by_state.T + noise
        variances[unreached] = covariance.diagonal()[POSITION][unreached]
        spreads.append((variances[:2].amax().sqrt().item(), variances[2].sqrt().item()))
        unreached = unreached & (reach[POSITION].abs().amax(-1) <= _REACHES)
        reach = by_state @ reach
    return tuple(spreads)


def _covariance(deviations: tuple[float, float, float, float]) -> Float[Tensor, "12 12"]:
    return torch.tensor(deviations, dtype=torch.float64).repeat_interleave(3).square().diag()


def _linearised(robot: Robot, dt: float) -> tuple[Float[Tensor, "12 12"], Float[Tensor, "12 a"]]:
    """A and B of the dynamics where the robot holds."""
    rest = RigidState.at_rest((0.0, 0.0, 0.0))
    action = robot.hold(rest, dt).double()
    rest = rest.to(torch.float64)
    after = robot.step(rest, action, dt)

    def error(tangent: Tensor, change: Tensor) -> Tensor:
        return after.local(robot.step(rest.retract(tangent), action + change, dt))

    still = (torch.zeros(TANGENT, dtype=torch.float64), torch.zeros_like(action))
    by_state, by_action = torch.autograd.functional.jacobian(error, still)
    return by_state, by_action

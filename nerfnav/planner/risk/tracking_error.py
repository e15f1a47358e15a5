"""Tracking error covariance: the deviation from the plan by noise that no controller can avoid.

    x_{t+1} = f(x_t, u_t) + w_t,  w ~ N(0, Q);   A = df/dx, B = df/du at rest;   S covariance of an estimate

The picture at the end of a step shows what its noise did, and the action that answers moves the position d steps
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
from jaxtyping import Float, Int
from torch import Tensor

from nerfnav.robots import PAPER_NOISE, POSITION, TANGENT, NoiseModel, RigidState, Robot

_REACHES = 1e-9
"""Change of a number of the state by a unit of action that counts as none."""


@dataclass(frozen=True)
class RiskContext:
    """Properties of the flight on which the risk of a plan depends."""

    dt: float = 0.1
    """Length of a step [s]."""
    noise: NoiseModel = PAPER_NOISE
    """Noise of the flight."""
    pace: float | None = None
    """Distance of a step [m] on which risk counts once, for plans whose arrival is put off; None: once for each step.
    """
    height: float | None = None
    """Height of a robot that never leaves it [m]."""
    end: tuple[float, float, float, float] | None = None
    """End of the plan, position [m] and heading [rad], for plans whose arrival is put off: chances up to that at the
    end count as none. Noise keeps pushing the robot off the straight way to it, and by a detour through safe space in
    each plan it would hover beside a goal near a wall or a floor, and never arrive. None: all chances count."""


PAPER_RISK_CONTEXT = RiskContext()
"""Context of a plan in the paper's steps and noise."""


@dataclass(frozen=True)
class Deviation:
    """Standard deviation of the position around a plan [m]."""

    level: float
    """Along the worse of two level axes."""
    height: float
    """Along the vertical."""


@lru_cache(maxsize=32)
def tracking_deviations(robot: Robot, dt: float, noise: NoiseModel) -> tuple[Deviation, ...]:
    """Predict the tracking error after the first steps, one by one; the last holds after all later ones too.

    Axes that actions do not reach at rest, such as a cart's to the side, count as reached in the fewest steps that the
    robot can plan.
    """
    by_state, degrees = relative_degrees(robot, dt)
    process, covariance = (part.covariance(torch.float64) for part in (noise.process, noise.estimate))
    degrees, variances = degrees[POSITION], torch.zeros(3, dtype=torch.float64)
    deviations: list[Deviation] = []
    for step in range(1, int(degrees.max()) + 1):
        covariance = by_state @ covariance @ by_state.T + process
        variances = torch.where(degrees >= step, covariance.diagonal()[POSITION], variances)
        deviations.append(Deviation(variances[:2].amax().sqrt().item(), variances[2].sqrt().item()))
    return tuple(deviations)


@lru_cache(maxsize=32)
def relative_degrees(robot: Robot, dt: float) -> tuple[Float[Tensor, "12 12"], Int[Tensor, "12"]]:
    """Compute A and the relative degree d of each number of the tangent, at rest, in steps of `dt` [s].

    What actions do not reach counts as reached in the fewest steps that the robot can plan.
    """
    by_state, reach = _linearise(robot, dt)
    degrees = torch.full((TANGENT,), robot.minimum_steps)
    for step in range(robot.minimum_steps, 0, -1):
        reached = (torch.linalg.matrix_power(by_state, step - 1) @ reach).abs().amax(-1) > _REACHES
        degrees[reached] = step
    return by_state, degrees


def _linearise(robot: Robot, dt: float) -> tuple[Float[Tensor, "12 12"], Float[Tensor, "12 a"]]:
    """Differentiate the dynamics at rest: A and B."""
    rest = RigidState.at_rest((0.0, 0.0, 0.0))
    action = robot.hold(rest, dt).double()
    rest = rest.to(torch.float64)
    after = robot.step(rest, action, dt)

    def error(tangent: Tensor, change: Tensor) -> Tensor:
        return after.local(robot.step(rest.retract(tangent), action + change, dt))

    still = (torch.zeros(TANGENT, dtype=torch.float64), torch.zeros_like(action))
    by_state, by_action = torch.autograd.functional.jacobian(error, still)
    return by_state, by_action

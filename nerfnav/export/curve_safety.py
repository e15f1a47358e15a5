"""Safety of an exported curve: judge it on the field once more, because it cuts the corners of the judged plan."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.field import Field
from nerfnav.geometry import so3
from nerfnav.planner import PiecewisePolynomial, PlanOutcome, PlanProblem, assess_safety, downgrade_outcome
from nerfnav.robots import Motion, Quadrotor, RigidState, thrust_and_attitude

RATE_HZ = 50
"""Poses of the curve that are judged in a second."""


@dataclass(frozen=True)
class CurveSafety:
    """Safety of a curve in a field."""

    outcome: PlanOutcome
    """CONVERGED, or what is wrong with it."""
    bound: float
    """Upper bound of the probability of a collision."""
    min_clearance_m: float | None
    """Smallest distance of a body point from dense space [m]; None where none is within reach."""


def judge_curve(field: Field, shape: PiecewisePolynomial, robot: Quadrotor) -> CurveSafety:
    """Judge a curve of x, y, z [m] and yaw [rad] that this robot flies in this field, the one to plan in."""
    motion = motion_along(shape, robot)
    problem = PlanProblem(field, robot, motion.states[0], motion.states[-1], len(motion.actions), motion.dt)
    safety = assess_safety(field, motion, robot.body)
    return CurveSafety(downgrade_outcome(problem, motion, PlanOutcome.CONVERGED), safety.bound, safety.min_clearance_m)


def motion_along(shape: PiecewisePolynomial, robot: Quadrotor) -> Motion:
    """The curve as states RATE_HZ times a second, attitudes by differential flatness; actions are left at 0."""
    count = max(2, round(RATE_HZ * float(shape.times[-1])))
    times = torch.linspace(0.0, float(shape.times[-1]), count + 1, dtype=torch.float64)
    values, rates, accelerations = (shape(times, order) for order in range(3))
    pull = accelerations[:, :3] + accelerations.new_tensor([0.0, 0.0, robot.config.gravity])
    _, rotation = thrust_and_attitude(pull, values[:, 3])
    dt = float(times[1])
    states = RigidState(*(part.float() for part in (values[:, :3], rates[:, :3], rotation, _body_rates(rotation, dt))))
    return Motion(states, torch.zeros(count, len(robot.action_names)), dt)


def _body_rates(rotation: Float[Tensor, "n 3 3"], dt: float) -> Float[Tensor, "n 3"]:
    """[rad/s] from each attitude to the next; the last one has none."""
    turned = so3.log(rotation[:-1].transpose(-1, -2) @ rotation[1:]) / dt
    return torch.cat([turned, torch.zeros_like(turned[:1])])

"""Where a plan goes on after its first actions were flown and the robot turned out to be elsewhere."""

import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import so3
from nerfnav.planner.route import Route
from nerfnav.planner.trajectory import Trajectory
from nerfnav.robots import Motion, RigidState, Robot, unwrapped

_RECOVERY_S = 1.2
"""Time over which a robot returns to its plan [s]: sooner takes sharp turns, later drifts into what is near."""


def hot_start(
    motion: Motion, start: RigidState, goal: RigidState, robot: Robot, *, executed: int = 1, steps: int | None = None
) -> Trajectory:
    """The rest of a motion, as seen from a new start.

    Left alone, the planned actions would carry the new start (a filter's mean) away from the plan. The waypoints
    follow where they would carry it, fade back to the plan, and end at the goal. `steps` is the new horizon: by
    default what is left, at least the fewest that the robot can plan; a longer horizon waits at the goal.
    Raises InvalidInputError for a horizon shorter than what is left, in which the goal would come too soon.
    """
    left = motion.actions.shape[-2] - executed
    steps = max(left, robot.minimum_steps) if steps is None else steps
    if not 0 <= left <= steps:
        raise InvalidInputError(f"a horizon of {steps} steps does not hold the {left} that are left of the motion")
    planned = motion.states[executed:]
    back = (torch.arange(left + 1) * motion.dt / min(_RECOVERY_S, max(left, 1) * motion.dt)).clamp_max(1)
    away = 1 - back.square() * (3 - 2 * back)
    astray = int((away > 0).sum())  # steps from which nothing of the drift is left need no rolling out
    rolled = robot.way_under(start, motion.actions[executed:][: astray - 1], motion.dt)
    positions = planned.position.clone()
    positions[:astray] += away[:astray, None] * (rolled - positions[:astray])
    index = torch.arange(steps + 1).clamp_max(left)
    yaws = unwrapped(so3.yaw_of(planned.rotation))[index]
    turn = so3.yaw_of(goal.rotation @ planned.rotation[-1].mT)  # by which the goal has turned since
    yaws = yaws + turn * torch.arange(steps + 1) / max(steps, 1)
    waypoints = torch.cat([positions[index], yaws[:, None]], -1)
    return Trajectory(robot.encode(waypoints, start, goal, motion.dt), Route(start, goal, steps, motion.dt))

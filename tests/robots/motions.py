"""Ends and free numbers that suit any robot."""

import torch

from nerfnav import robots
from nerfnav.geometry import so3
from nerfnav.robots.robot import Robot
from nerfnav.robots.state import Motion, RigidState

STEPS, DT = 12, 0.1
PARTS = ("position", "velocity", "rotation", "body_rate")
EVERY = {name: robots.load(name) for name in robots.names()}
"""A new robot needs no line of its own: its tests are these."""
SMALL = {name: robot for name, robot in EVERY.items() if max(robot.body.extents) < 0.3001}
"""Those that fit into the test places of the planners, which are 2 m wide."""


def ends(robot: Robot, seed: int = 0, *, still: bool = False, goal_yaw: float = -2.0) -> tuple[RigidState, RigidState]:
    """Two states that the robot can be in, at rest or moving, in double precision."""
    generator = torch.Generator().manual_seed(seed)
    height = 0.5 if robot.planar else 0.3
    states = [RigidState.at_rest((0.0, 0.0, 0.5), 0.4), RigidState.at_rest((0.8, 0.5, height), goal_yaw)]
    pushed = []
    for state in (state.to(torch.float64) for state in states):
        push = 0.0 if still else 0.2 * torch.randn(12, generator=generator, dtype=torch.float64)
        pushed.append(robot.settled(state.retract(push + torch.zeros(12, dtype=torch.float64)), state))
    first, second = (RigidState(s.position, s.velocity, so3.project(s.rotation), s.body_rate) for s in pushed)
    return first, second


def free_numbers(
    robot: Robot, between: tuple[RigidState, RigidState], spread: float = 0.0, seed: int = 0
) -> torch.Tensor:
    """Those of the straight way between two states, more or less disturbed."""
    start, goal = between
    share = eased()
    yaw = so3.yaw_of(start.rotation) + share * (so3.yaw_of(goal.rotation) - so3.yaw_of(start.rotation))
    line = start.position + share * (goal.position - start.position)
    free = robot.encode(torch.cat([line, yaw], -1), start, goal, DT)
    noise = torch.randn(free.shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)
    return free + spread * noise


def eased() -> torch.Tensor:
    """Share of a way that is covered at each time."""
    time = torch.linspace(0, 1, STEPS + 1, dtype=torch.float64)[:, None]
    return time**2 * (3 - 2 * time)


def rolled_out(robot: Robot, motion: Motion) -> RigidState:
    """Where the actions of a motion lead from its first state."""
    states = [motion.states[0]]
    for action in motion.actions:
        states.append(robot.step(states[-1], action, motion.dt))
    return RigidState.stack(states)


def largest_difference(states: RigidState, others: RigidState) -> float:
    """Over all numbers of some states."""
    return max((getattr(states, part) - getattr(others, part)).abs().max().item() for part in PARTS)

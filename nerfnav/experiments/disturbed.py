"""Flights to try pose filters on: planned, then flown blindly, disturbed by the paper's noise.

They are drawn anew until they touch nothing and have something in sight all the time: without a picture of anything
there is nothing to estimate by.
"""

from functools import lru_cache

import torch
from torch import Tensor

from nerfnav.errors import InvalidInputError
from nerfnav.estimator import StateNoise
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.flights import Trial
from nerfnav.geometry import FORWARD_MOUNT
from nerfnav.planner import FastPlanConfig, FastPlanner, Route, last_step, with_room
from nerfnav.robots import CAMERA, Motion, Quadrotor, RigidState
from nerfnav.world import MeshRenderer, Task, contact_check

STEPS, DT = 20, 0.1
"""Time steps of a flight, and their length [s]."""
_REDRAWS = 2000
"""Blind flights drift, and of some tasks not one in fifty touches nothing."""
_IN_SIGHT = 0.05
"""Least share of each picture that shows more than sky."""
_GLANCE = CAMERA.scaled(0.2)
"""What looks whether anything is in sight."""


def disturbed_flight(arena: Arena, trial: Trial) -> tuple[Tensor, RigidState]:
    """Actions (20, 4) of a plan, and the states (21) under noise: nothing is touched, and something always in sight."""
    robot, plan = Quadrotor(), _plan(arena, trial.task)
    touches, renderer = contact_check(arena.scene, robot.body), MeshRenderer(arena.scene)
    generator = torch.Generator().manual_seed(trial.seed)
    states = [trial.task.start_state]
    for _ in range(_REDRAWS):
        states = states[:1]
        for action in plan.actions:
            states.append(robot.step(states[-1], action, DT).retract(StateNoise().sample(generator)))
            if touches(states[-2], states[-1]) or _share_in_sight(renderer, states[-1]) < _IN_SIGHT:
                break
        else:
            return plan.actions, RigidState.stack(states)
    raise InvalidInputError(
        f'of {_REDRAWS} blind flights of "{trial.task.name}" all touch something or lose sight of everything: '
        "estimate on another task"
    )


def _share_in_sight(renderer: MeshRenderer, state: RigidState) -> float:
    """Share of a picture that shows more than sky."""
    depth = renderer.render(_GLANCE, state.pose.compose(FORWARD_MOUNT)).depth
    return depth.isfinite().float().mean().item()


@lru_cache(maxsize=64)
def _plan(arena: Arena, task: Task) -> Motion:
    """The flight as it was planned, with room for noise."""
    planner = FastPlanner(arena.field, Quadrotor(), with_room(FastPlanConfig()))
    return last_step(planner.plan(Route(task.start_state, task.goal_state, STEPS, DT))).motion

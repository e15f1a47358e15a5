"""Disturbed flights: plan, then fly blindly under the paper's noise, to try pose filters on.

Flights are redrawn until they touch nothing and have something in view all the time, which the filter needs. The tasks
alternate; the filter under trial is made once in each process.
"""

from collections.abc import Callable, Generator
from dataclasses import dataclass
from functools import lru_cache

import torch
from torch import Tensor

from nerfnav import robots
from nerfnav.core.errors import InvalidInputError
from nerfnav.core.steps import run_steps
from nerfnav.estimator import FastFilter, FilterConfig
from nerfnav.experiments.arena import Arena, per_arena
from nerfnav.experiments.study import Row, Study, TrialDone, run_trials
from nerfnav.geometry import FORWARD_MOUNT
from nerfnav.planner import FastPlanConfig, FastPlanner, Route, with_room
from nerfnav.robots import CAMERA, Motion, Quadrotor, RigidState, StateNoise
from nerfnav.world import MeshRenderer, Task, contact_check

_TRIALS = 100


@dataclass(frozen=True)
class Trial:
    """Trial of an experiment: one flight."""

    task: Task
    """From where to where."""
    seed: int
    """Of everything random in it."""


def run_over_flights(
    study: Study, label: str, trial: Callable[[Arena, Trial], list[Row]]
) -> Generator[TrialDone, bool | None, list[Row]]:
    """Do a trial on as many flights as the study asks for, the tasks in turn; returns the rows of all."""
    trials = [
        Trial(study.tasks[index % len(study.tasks)], study.seed * _TRIALS + index)
        for index in range(study.trials or _TRIALS)
    ]
    answers = yield from run_trials(study, label, trial, trials)
    return [row for answer in answers for row in answer]


@per_arena
def fast_filter(arena: Arena) -> FastFilter:
    """The quadrotor's filter for the arena's field, made once in each process."""
    return FastFilter(arena.field, robots.load("quadrotor"), CAMERA, config=FilterConfig().for_field(arena.field.info))


STEPS, DT = 20, 0.1
"""Time steps of a flight, and their length [s]."""
_REDRAWS = 2000
"""Blind flights drift, and of some tasks not one in fifty touches nothing."""
_IN_SIGHT = 0.05
"""Least share of each picture that shows more than sky."""
_PROBE = CAMERA.scaled(0.2)
"""Camera of the visibility check."""


def fly_disturbed(arena: Arena, trial: Trial) -> tuple[Tensor, RigidState]:
    """Actions (20, 4) of a plan, and the states (21) under noise, without contacts and with something in view."""
    robot, plan = Quadrotor(), _plan(arena, trial.task)
    touches, renderer = contact_check(arena.scene, robot.body), MeshRenderer(arena.scene)
    generator = torch.Generator().manual_seed(trial.seed)
    for _ in range(_REDRAWS):
        states = [trial.task.start_state]
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
    return renderer.render(_PROBE, state.pose.compose(FORWARD_MOUNT)).depth.isfinite().float().mean().item()


@lru_cache(maxsize=64)
def _plan(arena: Arena, task: Task) -> Motion:
    """The flight as it was planned, with room for noise."""
    planner = FastPlanner(arena.field, Quadrotor(), with_room(FastPlanConfig()))
    return run_steps(planner.plan(Route(task.start_state, task.goal_state, STEPS, DT))).motion

"""The paper's comparison of pose filters: who follows a robot that only sees?

Planned flights are flown blindly, disturbed by the paper's noise, and photographed from the mesh; all estimators get
the same first belief, the same actions and the same pictures. Flights are drawn anew until they touch nothing and have
something in sight all the time: without a picture of anything there is no estimator to compare.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import torch
from matplotlib.figure import Figure
from torch import Tensor

from nerfnav import robots
from nerfnav.errors import InvalidInputError
from nerfnav.estimator.belief import Belief
from nerfnav.estimator.covariance import POSE
from nerfnav.estimator.estimator import Estimator
from nerfnav.estimator.fast import FastFilter, inerf
from nerfnav.estimator.filter import FilterConfig
from nerfnav.estimator.noise import StateNoise
from nerfnav.estimator.steps import FilterOutcome
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.figures import COLORS, panels
from nerfnav.experiments.study import ExperimentStep, Results, Row, Study, run_trials
from nerfnav.experiments.views import CAMERA, SUPERSAMPLE, take_picture
from nerfnav.geometry.camera import FORWARD_MOUNT
from nerfnav.navigation.planners import FastPlanner
from nerfnav.navigation.replan import with_room
from nerfnav.planner.fast import FastPlanConfig
from nerfnav.planner.steps import last_step
from nerfnav.robots.state import ATTITUDE, BODY_RATE, POSITION, VELOCITY, Motion, RigidState
from nerfnav.world.contact import contact_check
from nerfnav.world.raycast import MeshRenderer
from nerfnav.world.scene import Task

METHODS = ("nerfnav", "inerf")
"""Who takes part: the fast filter, and dynamically-informed iNeRF."""
ERRORS = {"position_m": POSITION, "rotation_rad": ATTITUDE, "velocity_mps": VELOCITY, "rate_radps": BODY_RATE}
"""Parts of the error, the length of each."""
_TRIALS, _STEPS, _DT = 100, 20, 0.1
_FIRST = StateNoise.isotropic(0.01**2)  # spread of the first belief: 1 cm, 0.01 rad
_REDRAWS = 2000
"""Blind flights drift, and of some tasks not one in fifty touches nothing."""
_IN_SIGHT = 0.05
"""Least share of each picture that shows more than sky."""
_GLANCE = CAMERA.scaled(0.2)
"""What looks whether anything is in sight."""
_LOST = {"position_m": 0.1, "rotation_rad": 0.2}
"""A trial has diverged that ends further off than this."""
_ELLIPSOID_95 = 7.815
"""95 % of a chi-squared of three numbers."""


@dataclass(frozen=True)
class Trial:
    """One flight."""

    task: Task
    """From where to where."""
    seed: int
    """Of everything random in it."""


def run(study: Study) -> Iterator[ExperimentStep]:
    """Fly and estimate; the table has a line for each trial, method and time step."""
    count = study.trials or _TRIALS
    trials = [Trial(study.tasks[index % len(study.tasks)], study.seed * _TRIALS + index) for index in range(count)]
    answers = yield from run_trials(study, "estimating", follow, trials)
    rows = [row for answer in answers for row in answer]
    yield Results(summary_of(rows), tuple(rows), {"estimation": picture(rows)})


def follow(arena: Arena, trial: Trial) -> list[Row]:
    """Fly once, and let every method estimate."""
    actions, truths = disturbed_flight(arena, trial)
    renderer = MeshRenderer(arena.scene, supersample=SUPERSAMPLE)
    images = [take_picture(renderer, truths[index].pose) for index in range(1, _STEPS + 1)]
    start = truths[0].retract(_FIRST.sample(torch.Generator().manual_seed(trial.seed)))
    rows = []
    for method in METHODS:
        generator = torch.Generator().manual_seed(trial.seed)
        belief = Belief(start, _FIRST.covariance())
        for index, (action, image) in enumerate(zip(actions, images, strict=True)):
            *_, last = _estimators(arena)[method].update(belief, image, action, _DT, generator)
            assert last.posterior is not None, "the last step of an estimator has the posterior"
            belief = last.posterior
            judged = judge(belief, truths[index + 1])
            rows.append({"seed": trial.seed, "task": trial.task.name, "method": method, "step": index + 1} | judged
                        | {"outcome": (last.outcome or FilterOutcome.UPDATED).name.lower()})  # fmt: skip
    return rows


def disturbed_flight(arena: Arena, trial: Trial) -> tuple[Tensor, RigidState]:
    """Actions (20, 4) of a plan, and the states (21) under noise: nothing is touched, and something always in sight."""
    robot, plan = robots.load("quadrotor"), _plan(arena, trial.task)
    touches, renderer = contact_check(arena.scene, robot.body), MeshRenderer(arena.scene)
    generator = torch.Generator().manual_seed(trial.seed)
    states = [trial.task.start_state]
    for _ in range(_REDRAWS):
        states = states[:1]
        for action in plan.actions:
            states.append(robot.step(states[-1], action, _DT).retract(StateNoise().sample(generator)))
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


def judge(belief: Belief, truth: RigidState) -> Row:
    """How far off a belief is, and whether it knew."""
    error = belief.mean.local(truth)
    covariance = belief.covariance.double()

    def nees(index: list[int]) -> float:
        part = error[index].double()
        return (part @ torch.linalg.solve(covariance[index][:, index], part)).item()

    lengths = {name: error[part].norm().item() for name, part in ERRORS.items()}
    place = nees([0, 1, 2])
    return lengths | {"nees_pose": nees(POSE), "nees": nees([*range(12)]), "inside_95": place < _ELLIPSOID_95}


def summary_of(rows: Sequence[Row]) -> Row:
    """Errors of both methods over all steps and at the end, and the honesty of nerfnav's covariance."""
    methods = {method: _summary([row for row in rows if row["method"] == method]) for method in METHODS}
    own = [row for row in rows if row["method"] == "nerfnav"]
    return {
        "methods": methods,
        "ratios": {
            name: methods["nerfnav"][name] / methods["inerf"][name]
            for name in methods["nerfnav"]
            if "rmse" in name and methods["inerf"][name] > 0
        },
        "nees_pose_mean": _mean(own, "nees_pose"),
        "nees_mean": _mean(own, "nees"),
        "inside_95": _mean(own, "inside_95"),
    }


def picture(rows: Sequence[Row]) -> Figure:
    """Mean errors over the steps, with bands of one standard deviation, as in the paper."""
    units = {"position_m": "[m]", "rotation_rad": "[rad]", "velocity_mps": "[m/s]", "rate_radps": "[rad/s]"}
    figure, axes = panels([f"{name.rpartition('_')[0].capitalize()} error {unit}" for name, unit in units.items()])
    for ax, name in zip(axes, ERRORS, strict=True):
        for method, color in zip(METHODS, COLORS, strict=False):
            steps = range(1, _STEPS + 1)
            table = [
                torch.tensor([row[name] for row in rows if row["method"] == method and row["step"] == step])
                for step in steps
            ]
            mean = torch.stack([entries.mean() for entries in table])
            spread = torch.stack([entries.std(correction=0) for entries in table])
            ax.plot(steps, mean, color=color, label=method)
            ax.fill_between(steps, (mean - spread).clamp_min(0), mean + spread, color=color, alpha=0.25, linewidth=0)
        ax.set_xlabel("step")
        ax.set_ylim(bottom=0)
    axes[0].legend(frameon=False)
    return figure


def _summary(rows: Sequence[Row]) -> Row:
    last = [row for row in rows if row["step"] == _STEPS]
    unit = {name: f"{name.rpartition('_')[0]}_rmse_{name.rpartition('_')[2]}" for name in ERRORS}
    summary: Row = {unit[name]: _rms(rows, name) for name in ERRORS}
    summary |= {f"final_{unit[name]}": _rms(last, name) for name in ("position_m", "rotation_rad")}
    lost = [row for row in last if any(not row[name] <= bound for name, bound in _LOST.items())]
    return summary | {"diverged": len(lost), "trials": len(last)}


def _rms(rows: Sequence[Row], name: str) -> float:
    return math.sqrt(sum(row[name] ** 2 for row in rows) / len(rows))


def _mean(rows: Sequence[Row], name: str) -> float:
    return sum(row[name] for row in rows) / len(rows)


@lru_cache(maxsize=2)
def _estimators(arena: Arena) -> dict[str, Estimator]:
    """All methods, made once in each process."""
    robot = robots.load("quadrotor")
    config = FilterConfig().for_field(arena.field.info.noise_std)
    return {
        "nerfnav": FastFilter(arena.field, robot, CAMERA, config=config),
        "inerf": inerf(arena.field, robot, CAMERA, config=config),
    }


@lru_cache(maxsize=64)
def _plan(arena: Arena, task: Task) -> Motion:
    """The flight as it was planned, with room for noise."""
    planner = FastPlanner(arena.field, robots.load("quadrotor"), with_room(FastPlanConfig()))
    return last_step(planner.plan(task.start_state, task.goal_state, _STEPS, _DT)).motion

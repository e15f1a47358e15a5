"""Comparison of pose filters (paper): follow a robot by its pictures with the fast filter and with iNeRF.

Disturbed flights (see experiments/disturbed_flights.py) are photographed from the mesh; all estimators get the same
first belief, the same actions and the same pictures. Errors of a belief come with its NEES (normalized
estimation error squared), which measures the consistency of its covariance.
"""

import math
from collections.abc import Sequence
from functools import partial

import torch

from nerfnav.core.steps import run_steps
from nerfnav.estimator import ELLIPSOID_95, Belief, Estimator, inerf
from nerfnav.estimator.core.belief import POSE
from nerfnav.experiments.arena import Arena, make_renderer, per_arena, take_picture
from nerfnav.experiments.disturbed_flights import DT, STEPS, Trial, fast_filter, fly_disturbed, run_over_flights
from nerfnav.experiments.figures import COLORS, Figure, panels
from nerfnav.experiments.study import ExperimentSteps, Results, Row, Study
from nerfnav.robots import ATTITUDE, BODY_RATE, POSITION, VELOCITY, RigidState, StateNoise

METHODS = ("nerfnav", "inerf")
"""Contenders: the fast filter, and dynamically-informed iNeRF."""
ERRORS = {"position_m": POSITION, "rotation_rad": ATTITUDE, "velocity_mps": VELOCITY, "rate_radps": BODY_RATE}
"""Parts of the error, the length of each."""


def errors_of(belief: Belief, truth: RigidState) -> Row:
    """Errors and consistency of a belief."""
    error = belief.mean.local(truth)
    covariance = belief.covariance.double()

    def nees(index: list[int]) -> float:
        part = error[index].double()
        return (part @ torch.linalg.solve(covariance[index][:, index], part)).item()

    return {name: error[part].norm().item() for name, part in ERRORS.items()} | {
        "nees_pose": nees(POSE), "nees": nees([*range(12)]), "inside_95": nees([0, 1, 2]) < ELLIPSOID_95,
    }  # fmt: skip


_FIRST = StateNoise.isotropic(0.01**2)  # standard deviations of the first belief: 1 cm, 0.01 rad


def run(study: Study) -> ExperimentSteps:
    """Fly and estimate; the table has a line for each trial, method and time step."""
    rows = yield from run_over_flights(study, "estimating", follow)
    return Results(summarize(rows), tuple(rows), {"estimation": partial(draw_figure, rows)}, ("method",))


def follow(arena: Arena, trial: Trial) -> list[Row]:
    """Fly once, and let every method estimate."""
    actions, truths = fly_disturbed(arena, trial)
    images = [take_picture(make_renderer(arena), truths[index].pose) for index in range(1, STEPS + 1)]
    start = truths[0].retract(_FIRST.sample(torch.Generator().manual_seed(trial.seed)))
    rows = []
    for method in METHODS:
        generator = torch.Generator().manual_seed(trial.seed)
        belief = Belief(start, _FIRST.covariance())
        for step, (action, image) in enumerate(zip(actions, images, strict=True), 1):
            result = run_steps(_estimators(arena)[method].update(belief, image, action, DT, generator))
            belief = result.posterior
            rows.append({"seed": trial.seed, "task": trial.task.name, "method": method, "step": step}
                        | errors_of(belief, truths[step]) | {"outcome": result.outcome.name.lower()})  # fmt: skip
    return rows


@per_arena
def _estimators(arena: Arena) -> dict[str, Estimator]:
    """All methods, made once in each process."""
    own = fast_filter(arena)
    return {"nerfnav": own, "inerf": inerf(own.field, own.robot, own.camera, config=own.config)}


_LOST = {"position_m": 0.1, "rotation_rad": 0.2}
"""A trial has diverged that ends further off than this."""


def summarize(rows: Sequence[Row]) -> Row:
    """Summarize the errors of both methods over all steps and at the end, and the consistency of nerfnav's
    covariance."""
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


def draw_figure(rows: Sequence[Row]) -> Figure:
    """Mean errors over the steps, with bands of one standard deviation, as in the paper."""
    units = {"position_m": "[m]", "rotation_rad": "[rad]", "velocity_mps": "[m/s]", "rate_radps": "[rad/s]"}
    figure, axes = panels([f"{name.rpartition('_')[0].capitalize()} error {unit}" for name, unit in units.items()])
    for ax, name in zip(axes, ERRORS, strict=True):
        for method, color in zip(METHODS, COLORS, strict=False):
            steps = range(1, STEPS + 1)
            table = [
                torch.tensor([row[name] for row in rows if row["method"] == method and row["step"] == step])
                for step in steps
            ]
            mean = torch.stack([entries.mean() for entries in table])
            deviation = torch.stack([entries.std(correction=0) for entries in table])
            ax.plot(steps, mean, color=color, label=method)
            lower, upper = (mean - deviation).clamp_min(0), mean + deviation
            ax.fill_between(steps, lower, upper, color=color, alpha=0.25, linewidth=0)
        ax.set(xlabel="step", ylim=(0, None))
    axes[0].legend(frameon=False)
    return figure


def _summary(rows: Sequence[Row]) -> Row:
    last = [row for row in rows if row["step"] == STEPS]
    unit = {name: f"{name.rpartition('_')[0]}_rmse_{name.rpartition('_')[2]}" for name in ERRORS}
    summary: Row = {unit[name]: _rms(rows, name) for name in ERRORS}
    summary |= {f"final_{unit[name]}": _rms(last, name) for name in ("position_m", "rotation_rad")}
    diverged = sum(any(not row[name] <= bound for name, bound in _LOST.items()) for row in last)
    return summary | {"diverged": diverged, "trials": len(last)}


def _rms(rows: Sequence[Row], name: str) -> float:
    return math.sqrt(sum(row[name] ** 2 for row in rows) / len(rows))


def _mean(rows: Sequence[Row], name: str) -> float:
    return sum(row[name] for row in rows) / len(rows)

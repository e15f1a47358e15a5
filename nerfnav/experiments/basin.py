"""Basin of convergence: correct beliefs that are off by one picture with the pose filter.

The prior of a robot on a disturbed flight is off by so many centimetres in a random direction, and by so many radians
about a random axis. Its covariance covers such errors (standard deviation along each axis: the error's length over the
root of 3), and the fast filter corrects it by one picture from the mesh. Pictures of sky alone, from which nothing can
converge, count like all others.
"""

import math
import time
from collections.abc import Sequence
from functools import partial

import numpy as np
import torch
from torch import Tensor

from nerfnav.core.steps import run_steps
from nerfnav.estimator import Belief, FilterOutcome
from nerfnav.experiments.arena import Arena, make_renderer, take_picture
from nerfnav.experiments.disturbed_flights import Trial, fast_filter, fly_disturbed, run_over_flights
from nerfnav.experiments.figures import COLORS, Figure, draw_distribution, panels
from nerfnav.experiments.study import ExperimentSteps, Results, Row, Study
from nerfnav.robots import ATTITUDE, POSITION, TANGENT, RigidState, StateNoise

SIZES = ((0.02, 0.02), (0.05, 0.05), (0.1, 0.1), (0.2, 0.2))
"""Errors of the prior: position [m], attitude [rad]."""
CONVERGED = {"position_m": 0.01, "rotation_deg": 1.0}
"""An estimate has converged that is nearer than this."""
_MOVING = (0.1, 0.1)
"""Standard deviations of the prior's velocity [m/s] and body rate [rad/s]."""


def make_prior(truth: RigidState, size: tuple[float, float], generator: torch.Generator) -> Belief:
    """Make a belief whose mean is off by exactly `size` [m, rad], with a covariance that covers it."""
    direction, axis = torch.nn.functional.normalize(torch.randn(2, 3, generator=generator), dim=-1)
    error = torch.zeros(TANGENT)
    error[POSITION], error[ATTITUDE] = size[0] * direction, size[1] * axis
    deviations = StateNoise(size[0] / math.sqrt(3), _MOVING[0], size[1] / math.sqrt(3), _MOVING[1])
    return Belief(truth.retract(error), deviations.covariance())


def correct_prior(
    arena: Arena, truth: RigidState, image: Tensor, size: tuple[float, float], generator: torch.Generator
) -> Row:
    """Correct a prior with the error `size` by the picture from the true state."""
    belief = make_prior(truth, size, generator)
    begun = time.perf_counter()
    result = run_steps(fast_filter(arena).correct(belief, image, generator))
    ms = 1e3 * (time.perf_counter() - begun)
    error = result.posterior.mean.local(truth)
    errors = {
        "position_m": error[POSITION].norm().item(),
        "rotation_deg": math.degrees(error[ATTITUDE].norm().item()),
    }
    return {"error_m": size[0], "error_rad": size[1]} | errors | {
        "converged": all(errors[name] < bound for name, bound in CONVERGED.items()),
        "outcome": result.outcome.name.lower(),
        "ms": ms,
    }  # fmt: skip


def run(study: Study) -> ExperimentSteps:
    """Correct a belief of every size on every flight."""
    rows = yield from run_over_flights(study, "correcting", correct)
    return Results(summarize(rows), tuple(rows), {"basin": partial(draw_figure, rows)}, ("error_m", "error_rad"))


def correct(arena: Arena, trial: Trial) -> list[Row]:
    """One place of a flight, its picture, and a correction of each size."""
    generator = torch.Generator().manual_seed(trial.seed)
    _, states = fly_disturbed(arena, trial)
    truth = states[int(torch.randint(1, len(states.position), (1,), generator=generator))]
    image = take_picture(make_renderer(arena), truth.pose)
    return [
        {"seed": trial.seed, "task": trial.task.name} | correct_prior(arena, truth, image, size, generator)
        for size in SIZES
    ]


def summarize(rows: Sequence[Row]) -> Row:
    """Summarize convergence, noticed and unnoticed failures, errors and times for each size."""
    sizes = {_label(size): [row for row in rows if row["error_m"] == size[0]] for size in SIZES}
    blind, lost = (outcome.name.lower() for outcome in (FilterOutcome.PREDICTED_ONLY, FilterOutcome.DIVERGED))
    return {
        name: {
            "trials": len(mine),
            "converged_share": sum(row["converged"] for row in mine) / max(1, len(mine)),
            "saw_nothing": sum(row["outcome"] == blind for row in mine),
            "failed_knowingly": sum(row["outcome"] == lost for row in mine),
            "failed_unknowingly": sum(not row["converged"] and row["outcome"] not in (blind, lost) for row in mine),
            "position_median_m": float(np.median([row["position_m"] for row in mine])),
            "rotation_median_deg": float(np.median([row["rotation_deg"] for row in mine])),
            "ms_median": float(np.median([row["ms"] for row in mine])),
        }
        for name, mine in sizes.items()
        if mine
    }


def draw_figure(rows: Sequence[Row]) -> Figure:
    """Share of estimates that end as near, for each size of the first error."""
    figure, axes = panels(("Position", "Rotation"))
    for ax, (name, bound) in zip(axes, CONVERGED.items(), strict=True):
        for size, color in zip(SIZES, COLORS, strict=False):
            errors = [row[name] for row in rows if row["error_m"] == size[0]]
            draw_distribution(ax, errors, color, f"from {_label(size)}")
        ax.axvline(bound, color="grey", linewidth=0.8)
        ax.set(xscale="log", ylim=(0, 1), xlabel=f"final error [{name.rpartition('_')[2]}]")
    axes[0].set_ylabel("share of pictures")
    axes[1].legend(frameon=False, fontsize=7)
    return figure


def _label(size: tuple[float, float]) -> str:
    return f"{100 * size[0]:g} cm, {size[1]:g} rad"

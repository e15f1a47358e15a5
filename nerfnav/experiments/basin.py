"""Basin of convergence: correct beliefs that are off by one picture with the pose filter.

Robots on disturbed flights are believed to be elsewhere: off by so many centimetres in a random direction, and turned
by so many radians about a random axis. The prior knows how large such errors are (a standard deviation of the error's
length over the root of 3 along each axis), and the fast filter corrects it by one picture from the mesh. Pictures of
nothing but sky, from which nothing can converge, count like all others.
"""


import math
import time
from collections.abc import Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from nerfnav.core.steps import run_steps
from nerfnav.estimator import Belief, FilterOutcome
from nerfnav.experiments.disturbed_flights import Trial, fast_filter, fly_disturbed, run_over_flights
from nerfnav.experiments.figures import COLORS, panels
from nerfnav.experiments.held_out_views import make_renderer, take_picture
from nerfnav.experiments.study import Arena, ExperimentStep, Results, Row, Study
from nerfnav.robots import ATTITUDE, POSITION, TANGENT, RigidState, StateNoise

if TYPE_CHECKING:
    import matplotlib.figure


SIZES = ((0.02, 0.02), (0.05, 0.05), (0.1, 0.1), (0.2, 0.2))
"""How far the belief is off: position [m], attitude [rad]."""
CONVERGED = {"position_m": 0.01, "rotation_deg": 1.0}
"""An estimate has converged that is nearer than this."""


def summary_of(rows: Sequence[Row]) -> Row:
    """For each size: how many converged, how many did not and whether they knew, and how long it took."""
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


def picture(rows: Sequence[Row]) -> "matplotlib.figure.Figure":
    """Share of estimates that end as near, for each size of the first error."""
    figure, axes = panels(("Position", "Rotation"))
    for ax, (name, bound) in zip(axes, CONVERGED.items(), strict=True):
        for size, color in zip(SIZES, COLORS, strict=False):
            errors = np.sort([row[name] for row in rows if row["error_m"] == size[0]])
            share = np.arange(1, len(errors) + 1) / max(1, len(errors))
            ax.step(errors, share, where="post", color=color, label=f"from {_label(size)}")
        ax.axvline(bound, color="grey", linewidth=0.8)
        ax.set(xscale="log", ylim=(0, 1), xlabel=f"final error [{name.rpartition('_')[2]}]")
    axes[0].set_ylabel("share of pictures")
    axes[1].legend(frameon=False, fontsize=7)
    return figure


def _label(size: tuple[float, float]) -> str:
    return f"{100 * size[0]:g} cm, {size[1]:g} rad"


_MOVING = (0.1, 0.1)
"""Spread of the prior's velocity [m/s] and body rate [rad/s]."""


def prior(truth: RigidState, size: tuple[float, float], generator: torch.Generator) -> Belief:
    """A belief whose mean is off by exactly so much [m, rad], and whose covariance says so."""
    way, axis = torch.nn.functional.normalize(torch.randn(2, 3, generator=generator), dim=-1)
    error = torch.zeros(TANGENT)
    error[POSITION], error[ATTITUDE] = size[0] * way, size[1] * axis
    spread = StateNoise(size[0] / math.sqrt(3), _MOVING[0], size[1] / math.sqrt(3), _MOVING[1])
    return Belief(truth.retract(error), spread.covariance())


def corrected(
    arena: Arena, seen: tuple[RigidState, Tensor], size: tuple[float, float], generator: torch.Generator
) -> Row:
    truth, image = seen
    belief = prior(truth, size, generator)
    begun = time.perf_counter()
    result = run_steps(fast_filter(arena).correct(belief, image, generator))
    ms = 1e3 * (time.perf_counter() - begun)
    error = result.posterior.mean.local(truth)
    errors = {
        "position_m": error[POSITION].norm().item(),
        "rotation_deg": math.degrees(error[ATTITUDE].norm().item()),
    }
    converged = all(errors[name] < bound for name, bound in CONVERGED.items())
    outcome = result.outcome.name.lower()
    return {"error_m": size[0], "error_rad": size[1]} | errors | {"converged": converged, "outcome": outcome, "ms": ms}


def run(study: Study) -> Iterator[ExperimentStep]:
    """Correct a belief of every size on every flight."""
    rows = yield from run_over_flights(study, "correcting", correct)
    yield Results(summary_of(rows), tuple(rows), {"basin": partial(picture, rows)})


def correct(arena: Arena, trial: Trial) -> list[Row]:
    """One place of a flight, its picture, and a correction of each size."""
    generator = torch.Generator().manual_seed(trial.seed)
    _, states = fly_disturbed(arena, trial)
    truth = states[int(torch.randint(1, len(states.position), (1,), generator=generator))]
    image = take_picture(make_renderer(arena), truth.pose)
    where = {"seed": trial.seed, "task": trial.task.name}
    return [where | corrected(arena, (truth, image), size, generator) for size in SIZES]

"""Tangent planes of Adam: step in the tangent of the last state, or always in that of the prediction (paper Eq. 8).

    recursive   x_k+1 = x_k (+) d_k            every step in the tangent of the state before it
    single      x_k+1 = x_0 (+) (d_0 + ... + d_k)   all in the tangent plane of the prediction

Both start from the same wrong poses and minimise the same cost. Its picture is what the field itself shows from the
true pose, so that nothing but the planes is to blame for what is left, and reduced to an eighth: the large errors
would be hopeless at full size, with either. For small errors the two planes are alike; the further the attitude has
to turn, the more the single plane is bent against it: by half the angle in the direction of a step.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from statistics import median

import torch

from nerfnav.estimator import Belief, ColorNoise, DescentConfig, Observation
from nerfnav.estimator.paper.adam import descend
from nerfnav.estimator.paper.cost import PoseCost
from nerfnav.estimator.paper.retraction import retract
from nerfnav.estimator.photometric.pyramid import View
from nerfnav.experiments.arena import Arena, held_out_poses
from nerfnav.experiments.figures import COLORS, Figure, panels
from nerfnav.experiments.study import ExperimentSteps, Results, Row, Study, run_trials
from nerfnav.field import build_levels
from nerfnav.geometry import FORWARD_MOUNT
from nerfnav.robots import ATTITUDE, CAMERA, POSITION, TANGENT, RigidState, StateNoise

METHODS = {"recursive": True, "single plane": False}
"""The contenders, and whether each steps in the tangent of the last state."""
ERRORS = (0.1, 0.3, 0.6, 1.0)
"""Errors of the first attitude [rad]."""
ARRIVED_RAD, ARRIVED_M = 0.05, 0.05
"""A descent has converged that ends nearer to the truth than this, a pixel of 25 x 25."""
_PIXELS, _HALVINGS = 128, 3
_OFF = 0.02
"""Error of the first position, along each axis [m]."""


def first_guess(arena: Arena, seed: int, error_rad: float) -> tuple[RigidState, RigidState, PoseCost]:
    """Truth, a state whose attitude is off by an angle, and the cost of states around it."""
    generator = torch.Generator().manual_seed(seed)
    truth = held_out_poses(arena, 1, seed)[0]
    view = View(build_levels(arena.field, 1 + _HALVINGS), CAMERA, FORWARD_MOUNT).at(_HALVINGS)
    pixels = view.camera.pixels()
    pixels = pixels[torch.randperm(len(pixels), generator=generator)[:_PIXELS]]
    seen = Observation(view.field, view.camera, view.mount, pixels, torch.zeros(len(pixels), 3))
    seen = replace(seen, colors=seen.shown(truth.pose.map(lambda tensor: tensor[None]))[0])
    error = torch.zeros(TANGENT)
    error[POSITION] = _OFF * torch.randn(3, generator=generator)
    error[ATTITUDE] = error_rad * torch.nn.functional.normalize(torch.randn(3, generator=generator), dim=0)
    prediction = Belief(truth.retract(error), StateNoise(_OFF, _OFF, error_rad, _OFF).covariance())
    return truth, prediction.mean, PoseCost.of(seen, prediction, ColorNoise(alike=1.0))  # without noise: to be matched


_TRIALS, _ITERATIONS = 24, 120
_RATE = 0.05
"""Adam's first step of an attitude number [rad], so that both can reach the truth."""


@dataclass(frozen=True)
class Start:
    """Trial of the experiment: one first error."""

    seed: int
    """Of the place and the error."""
    error: float
    """Angle by which the first attitude is off [rad]."""
    iterations: int = _ITERATIONS
    """Adam's steps."""


def run(study: Study) -> ExperimentSteps:
    """Descend from every start with both methods; the table has a line for each start, method and iteration."""
    seeds = range(study.seed, study.seed + (study.trials or _TRIALS))
    starts = [Start(seed, error) for error in ERRORS for seed in seeds]
    tables = yield from run_trials(study, "going down", compare, starts)
    rows = tuple(row for table in tables for row in table)
    ends = tuple(row for row in rows if row["iteration"] == rows[-1]["iteration"])
    return Results(summarize(rows), rows, {"tangent": partial(draw_figure, rows)}, ("start_rad", "method"), ends)


def compare(arena: Arena, start: Start) -> list[Row]:
    """Cost and pose error of both over the iterations."""
    truth, first, cost = first_guess(arena, start.seed, start.error)
    rows = []
    for method, recursive in METHODS.items():
        config = DescentConfig(start.iterations, attitude_rate=_RATE, recursive=recursive)
        for iteration, (state, terms) in enumerate(descend(cost, first, config, retract)):
            off = truth.local(state)
            rows.append({
                "seed": start.seed, "start_rad": start.error, "method": method, "iteration": iteration,
                "cost": terms.total.item(), "position_m": off[POSITION].norm().item(),
                "rotation_rad": off[ATTITUDE].norm().item(),
            })  # fmt: skip
    return rows


def summarize(rows: Sequence[Row]) -> Row:
    """Summarize the final errors for each first error, and the iterations until the cost is within a tenth of its
    descent."""
    return {
        f"from_{error:g}_rad": {
            method: _summary([row for row in rows if row["start_rad"] == error and row["method"] == method])
            for method in METHODS
        }
        for error in ERRORS
    }


def _summary(rows: Sequence[Row]) -> Row:
    runs = [[row for row in rows if row["seed"] == seed] for seed in sorted({row["seed"] for row in rows})]
    arrived = [run[-1]["rotation_rad"] < ARRIVED_RAD and run[-1]["position_m"] < ARRIVED_M for run in runs]
    return {
        "trials": len(runs),
        "converged": sum(arrived) / len(runs),
        "final_cost_median": median(run[-1]["cost"] for run in runs),
        "final_position_m_median": median(run[-1]["position_m"] for run in runs),
        "final_rotation_rad_median": median(run[-1]["rotation_rad"] for run in runs),
        "iterations_to_a_tenth_median": median(_iterations_down(run) for run in runs),
    }


def _iterations_down(run: Sequence[Row], left: float = 0.1) -> int:
    """First iteration from which on no more than a share of the descent is left."""
    costs = [row["cost"] for row in run]
    bound = min(costs) + left * (costs[0] - min(costs))
    return max((index + 1 for index, cost in enumerate(costs) if cost > bound), default=0)


def draw_figure(rows: Sequence[Row]) -> Figure:
    """The error of the attitude over the iterations, from each first error: medians, and all trials."""
    figure, axes = panels([f"From {error:g} rad" for error in ERRORS])
    for error, drawn in zip(ERRORS, axes, strict=True):
        for method, color, style in zip(METHODS, COLORS, ("-", "--"), strict=False):
            mine = [row for row in rows if row["start_rad"] == error and row["method"] == method]
            curves = torch.tensor([
                [row["rotation_rad"] for row in mine if row["seed"] == seed]
                for seed in sorted({row["seed"] for row in mine})
            ])  # fmt: skip
            drawn.plot(curves.T.numpy(), color=color, alpha=0.2, linewidth=0.6)
            drawn.plot(curves.median(0).values.numpy(), style, color=color, label=method)
        drawn.set(yscale="log", xlabel="iteration")
    axes[0].set_ylabel("attitude error [rad]")
    axes[0].legend(frameon=False)
    return figure

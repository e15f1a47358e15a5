"""Results of the comparison of tangent planes: its numbers and its figure."""

from collections.abc import Sequence
from statistics import median
from typing import TYPE_CHECKING

import torch

from nerfnav.experiments.figures import COLORS, panels
from nerfnav.experiments.study import Row

if TYPE_CHECKING:
    import matplotlib.figure


METHODS = {"recursive": True, "single plane": False}
"""The contenders, and whether each steps in the tangent of the last state."""
ERRORS = (0.1, 0.3, 0.6, 1.0)
"""Errors of the first attitude [rad]."""
ARRIVED_RAD, ARRIVED_M = 0.05, 0.05
"""A descent has converged that ends nearer to the truth than this, a pixel of 25 x 25."""


def summary_of(rows: Sequence[Row]) -> Row:
    """For each error: what is left in the end, and how soon the cost is within a tenth of its way down."""
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
    """First iteration from which on no more than a share of the way down is left."""
    costs = [row["cost"] for row in run]
    bound = min(costs) + left * (costs[0] - min(costs))
    return max((index + 1 for index, cost in enumerate(costs) if cost > bound), default=0)


def picture(rows: Sequence[Row]) -> "matplotlib.figure.Figure":
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

"""Results of the comparison of pose filters: its numbers and its figure."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import torch

from nerfnav.experiments.disturbed import STEPS
from nerfnav.experiments.figures import COLORS, panels
from nerfnav.experiments.study import Row
from nerfnav.robots import ATTITUDE, BODY_RATE, POSITION, VELOCITY

if TYPE_CHECKING:
    import matplotlib.figure


METHODS = ("nerfnav", "inerf")
"""Who takes part: the fast filter, and dynamically-informed iNeRF."""
ERRORS = {"position_m": POSITION, "rotation_rad": ATTITUDE, "velocity_mps": VELOCITY, "rate_radps": BODY_RATE}
"""Parts of the error, the length of each."""
_LOST = {"position_m": 0.1, "rotation_rad": 0.2}
"""A trial has diverged that ends further off than this."""


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


def picture(rows: Sequence[Row]) -> "matplotlib.figure.Figure":
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
            spread = torch.stack([entries.std(correction=0) for entries in table])
            ax.plot(steps, mean, color=color, label=method)
            ax.fill_between(steps, (mean - spread).clamp_min(0), mean + spread, color=color, alpha=0.25, linewidth=0)
        ax.set_xlabel("step")
        ax.set_ylim(bottom=0)
    axes[0].legend(frameon=False)
    return figure


def _summary(rows: Sequence[Row]) -> Row:
    last = [row for row in rows if row["step"] == STEPS]
    unit = {name: f"{name.rpartition('_')[0]}_rmse_{name.rpartition('_')[2]}" for name in ERRORS}
    summary: Row = {unit[name]: _rms(rows, name) for name in ERRORS}
    summary |= {f"final_{unit[name]}": _rms(last, name) for name in ("position_m", "rotation_rad")}
    lost = [row for row in last if any(not row[name] <= bound for name, bound in _LOST.items())]
    return summary | {"diverged": len(lost), "trials": len(last)}


def _rms(rows: Sequence[Row], name: str) -> float:
    return math.sqrt(sum(row[name] ** 2 for row in rows) / len(rows))


def _mean(rows: Sequence[Row], name: str) -> float:
    return sum(row[name] for row in rows) / len(rows)

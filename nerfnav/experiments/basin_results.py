"""Results of the basin experiment: its numbers and its figure."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from nerfnav.estimator import FilterOutcome
from nerfnav.experiments.figures import COLORS, panels
from nerfnav.experiments.study import Row

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

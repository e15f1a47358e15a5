"""Results of the correlation experiment: its numbers and its figure."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import rankdata

from nerfnav.experiments.figures import COLORS, panels
from nerfnav.experiments.study import Row

if TYPE_CHECKING:
    import matplotlib.figure


_FEWEST = 4
"""Watched iterations before the plan is free, of which a correlation can be told."""


def summary_of(rows: Sequence[Row]) -> Row:
    """The correlations, and what is left of the overlap."""
    plans = [
        np.array([(row["loss"], row["overlap_m4"]) for row in rows if row["task"] == name]) for name in _names(rows)
    ]
    hit = [plan for plan in plans if plan[:, 1].max() > 0]
    until_free = [plan[: _first_free(plan) + 1] for plan in hit]
    each = [_spearman(part) for part in until_free if len(part) >= _FEWEST]
    return {
        "plans": len(plans),
        "plans_that_touched": len(hit),
        "plans_correlated": len(each),
        "spearman_median": float(np.median(each)) if each else None,
        "spearman_least": min(each, default=None),
        "spearman_pooled": _spearman(np.concatenate(until_free)) if until_free else None,
        "spearman_all_iterations": _spearman(np.concatenate(plans)) if hit else None,
        "final_overlap_m4_max": max((float(plan[-1, 1]) for plan in plans), default=None),
        "final_overlaps": sum(bool(plan[-1, 1] > 0) for plan in plans),
    }


def picture(rows: Sequence[Row]) -> "matplotlib.figure.Figure":
    """Loss against overlap, and both over the iterations of the plan that overlapped most."""
    figure, (cloud, course) = panels(("Every watched iteration", "One plan"), height=3.8)
    worst = max(rows, key=lambda row: row["overlap_m4"], default=None)
    for index, name in enumerate(_names(rows)):
        mine = [row for row in rows if row["task"] == name and row["overlap_m4"] > 0]
        color = COLORS[index % len(COLORS)]
        cloud.plot([r["overlap_m4"] for r in mine], [r["loss"] for r in mine], ".", color=color, markersize=4)
    cloud.set(xscale="log", yscale="log", xlabel="overlap along the way [m$^4$]", ylabel="collision loss")
    if worst is not None:
        mine = [row for row in rows if row["task"] == worst["task"]]
        when = [row["iteration"] for row in mine]
        course.plot(when, [row["loss"] / mine[0]["loss"] for row in mine], color=COLORS[0], label="loss")
        course.plot(when, [row["overlap_m4"] / worst["overlap_m4"] for row in mine], color=COLORS[1], label="overlap")
        course.set(xlabel="iteration", ylabel="share of the start's / the largest")
        course.legend(frameon=False, fontsize=9)
    return figure


def _names(rows: Sequence[Row]) -> list[str]:
    return list(dict.fromkeys(row["task"] for row in rows))


def _first_free(plan: np.ndarray) -> int:
    """Index of the first look (loss, overlap) at which nothing is touched any more; the last one if there is none."""
    free = np.flatnonzero(plan[:, 1] == 0)
    return int(free[0]) if len(free) else len(plan) - 1


def _spearman(plan: np.ndarray) -> float:
    return float(np.corrcoef(rankdata(plan[:, 0]), rankdata(plan[:, 1]))[0, 1])

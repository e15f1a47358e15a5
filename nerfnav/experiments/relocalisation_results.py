"""Results of the relocalisation experiment: its numbers and its figure."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from nerfnav.estimator import RelocaliseConfig, RelocaliseOutcome
from nerfnav.experiments.figures import COLORS, panels
from nerfnav.experiments.study import Row

if TYPE_CHECKING:
    import matplotlib.figure


KINDS = {"sighted": 0.25, "any": 0.0}
"""Least share of the picture that the mesh fills."""


def summary_of(rows: Sequence[Row]) -> Row:
    """For each kind of picture: how often the answer is right, how often it claims to be, and how long it takes."""
    return {kind: _summary([row for row in rows if row["kind"] == kind]) for kind in KINDS}


def _summary(rows: Sequence[Row]) -> Row:
    found = RelocaliseOutcome.FOUND.name.lower()
    right = [row for row in rows if row["right"]]
    return {
        "trials": len(rows),
        "right_share": len(right) / max(1, len(rows)),
        "found_and_right": sum(row["outcome"] == found for row in right),
        "found_but_wrong": sum(row["outcome"] == found and not row["right"] for row in rows),
        "right_but_unsure": sum(row["outcome"] != found for row in right),
        "position_median_m": _median(rows, "position_m"),
        "rotation_median_deg": _median(rows, "rotation_deg"),
        "seconds_median": _median(rows, "seconds"),
        "saw_no_mesh": sum(row["mesh_share"] == 0 for row in rows),
    }


def picture(rows: Sequence[Row]) -> "matplotlib.figure.Figure":
    """How many are how near, and how far off each is against how much it looks like the picture."""
    figure, (near, cloud) = panels(("Share of pictures that are as near", "Can the picture tell?"))
    for kind, color in zip(KINDS, COLORS, strict=False):
        mine = [row for row in rows if row["kind"] == kind]
        if mine:
            errors = np.sort([row["position_m"] for row in mine])
            near.step(errors, np.arange(1, len(mine) + 1) / len(mine), where="post", color=color, label=kind)
        for found, marker in ((True, "o"), (False, "x")):
            some = [row for row in mine if (row["outcome"] == "found") == found]
            cloud.plot(
                [row["difference_stds"] for row in some], [row["position_m"] for row in some],
                marker, color=color, markersize=4, label=f"{kind}, {'found' if found else 'not sure'}",
            )  # fmt: skip
    near.set(xscale="log", xlabel="position error [m]", ylim=(0, 1))
    cloud.axvline(RelocaliseConfig().gate, color="grey", linewidth=0.8)
    cloud.set(yscale="log", xlabel="difference [standard deviations of colour]", ylabel="position error [m]")
    near.legend(frameon=False)
    cloud.legend(frameon=False, fontsize=7)
    return figure


def _median(rows: Sequence[Row], name: str) -> float | None:
    return float(np.median([row[name] for row in rows])) if rows else None

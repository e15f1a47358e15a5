"""Results of the experiment with robots on the ground: its numbers and its figure."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import torch

from nerfnav import robots
from nerfnav.experiments.figures import COLORS, panels
from nerfnav.experiments.study import Row
from nerfnav.geometry import so3

if TYPE_CHECKING:
    import matplotlib.axes
    import matplotlib.figure


Way = list[list[float]]
"""x, y [m] and heading [rad] at each time."""
COUCH, WHEELS = "couch", "diffdrive"


def summary_of(rows: Sequence[Row]) -> Row:
    """Overlaps of couches that may turn and may not, and whether wheels slid."""
    turning, held = ([row for row in rows if row["robot"] == COUCH and row["heading_held"] is so]
                     for so in (False, True))  # fmt: skip
    wheels = [row for row in rows if row["robot"] == WHEELS]
    return {
        "couch_drives": len(turning),
        "couch_touched": sum(row["touched"] for row in turning),
        "couch_max_overlap_m3": max((row["max_overlap_m3"] for row in turning), default=None),
        "couch_held_touched": sum(row["touched"] for row in held),
        "couch_held_max_overlap_m3": max((row["max_overlap_m3"] for row in held), default=None),
        "gap_overlap_m3": turning[0]["max_overlap_m3"] if turning else None,
        "gap_overlap_held_m3": held[0]["max_overlap_m3"] if held else None,
        "wheel_drives": len(wheels),
        "wheel_touched": sum(row["touched"] for row in wheels),
        "wheel_lateral_speed_max_mps": max((row["lateral_speed_max_mps"] for row in wheels), default=None),
        "goal_missed_max_m": max((row["goal_missed_by_m"] for row in rows), default=None),
    }


def picture(rows: Sequence[Row], ways: Sequence[Way], walls: np.ndarray) -> "matplotlib.figure.Figure":
    """The first couch with and without its turn, and the ways of all wheels, from above."""
    from matplotlib.collections import LineCollection

    figure, (free, held, wheels) = panels(("May turn", "May not turn", "On wheels"), height=3.8)
    for axes, so in ((free, False), (held, True)):
        index = next((i for i, row in enumerate(rows) if row["robot"] == COUCH and row["heading_held"] is so), None)
        if index is not None:
            _trail(axes, ways[index], COUCH, COLORS[4 if rows[index]["touched"] else 0])
            overlap = 1e6 * rows[index]["max_overlap_m3"]
            axes.set_title(f"{axes.get_title()}: overlap {overlap:.3g} cm$^3$", fontsize=10)
    for k, index in enumerate(i for i, row in enumerate(rows) if row["robot"] == WHEELS):
        _trail(wheels, ways[index], WHEELS, COLORS[k // 2 % len(COLORS)])
    for axes in (free, held, wheels):
        axes.add_collection(LineCollection(walls.tolist(), colors="0.45", linewidths=0.8), autolim=False)
        axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
    return figure


def _trail(axes: "matplotlib.axes.Axes", way: Way, name: str, color: str) -> None:
    """Outlines of a robot along its way."""
    half = 0.5 * torch.tensor(robots.load(name).body.extents[:2])
    outline = half * torch.tensor([[1.0, 1.0], [1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]])
    for x, y, heading in way:
        corners = outline @ so3.from_yaw(torch.tensor(heading))[:2, :2].T + torch.tensor([x, y])
        axes.plot(*corners.T.tolist(), color=color, linewidth=0.6, alpha=0.7)
    axes.plot([x for x, _, _ in way], [y for _, y, _ in way], color=color, linewidth=1.2)

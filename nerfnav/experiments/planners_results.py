"""Results of the comparison of planners: its numbers and its figure."""

import statistics
from collections.abc import Sequence
from typing import TYPE_CHECKING

from nerfnav.experiments.figures import bars, panels
from nerfnav.experiments.study import Row

if TYPE_CHECKING:
    import matplotlib.figure


PLANNERS = ("nerfnav", "minsnap", "rrt")
"""Who takes part: all whose libraries are installed; the summary names the others under `left_out`."""


def summary_of(rows: Sequence[Row]) -> dict[str, Row]:
    """For each planner: its failures and what its plans cost on average."""
    summary = {}
    for name in _contenders(rows):
        mine = [row for row in rows if row["planner"] == name]
        summary[name] = {
            "flights": len(mine),
            "failures": sum(row["failed"] for row in mine),
            "touched": sum(row["touched"] for row in mine),
            "collision_mean": statistics.fmean(row["collision"] for row in mine),
            "collision_median": statistics.median(row["collision"] for row in mine),
            "effort_mean": statistics.fmean(row["effort"] for row in mine),
            "effort_median": statistics.median(row["effort"] for row in mine),
            "plan_ms_median": statistics.median(row["plan_ms"] for row in mine),
        }
    return summary


def picture(rows: Sequence[Row]) -> "matplotlib.figure.Figure":
    """Bars as in the paper's figure, and every flight as a dot."""
    figure, (collision, effort, failures) = panels(("Collision cost (Eq. 1)", "Control effort", "Failed flights"))
    names = _contenders(rows)
    for axes, key, unit in ((collision, "collision", "sum of density x way"), (effort, "effort", "sum of u' Gamma u")):
        spread = {name: [row[key] for row in rows if row["planner"] == name] for name in names}
        axes.set_yscale("log")
        bars(axes, {name: statistics.fmean(values) for name, values in spread.items()}, unit + ", mean", spread)
    failed = {name: float(sum(row["failed"] for row in rows if row["planner"] == name)) for name in names}
    bars(failures, failed, f"of {len(rows) // len(names)}")
    return figure


def _contenders(rows: Sequence[Row]) -> tuple[str, ...]:
    """The planners that took part, in the order of PLANNERS."""
    return tuple(name for name in PLANNERS if any(row["planner"] == name for row in rows))

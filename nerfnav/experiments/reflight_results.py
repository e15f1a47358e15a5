"""Results of the exports that were flown again: numbers and figure."""

import math
import statistics
from collections.abc import Sequence
from typing import TYPE_CHECKING

from nerfnav.experiments.figures import bars, panels
from nerfnav.experiments.study import Row

if TYPE_CHECKING:
    import matplotlib.figure


def summary_of(rows: Sequence[Row]) -> dict[str, Row]:
    """For each vehicle: how many flights were clean, and how far off they were (rms over all instants and flights)."""
    summary = {}
    for name in _vehicles(rows):
        mine = [row for row in rows if row["vehicle"] == name]
        flown = [row for row in mine if row["rms_mm"] is not None]
        summary[name] = {
            "exports": len(mine),
            "refused": len(mine) - len(flown),
            "clean": sum(bool(row["clean"]) for row in mine),
            "clean_plans": sum(not row["plan_touched"] for row in mine),
        }
        if flown:
            summary[name] |= {
                "rms_mm": math.sqrt(statistics.fmean(row["rms_mm"] ** 2 for row in flown)),
                "rms_mm_max": max(row["rms_mm"] for row in flown),
                "max_mm": max(row["max_mm"] for row in flown),
                "duration_s_mean": statistics.fmean(row["duration_s"] for row in flown),
            }
    return summary


def picture(rows: Sequence[Row]) -> "matplotlib.figure.Figure":
    """Errors of every flight as dots, and the largest of them as bars."""
    figure, (rms, most) = panels(("Tracking error, rms", "Tracking error, largest"))
    for axes, key in ((rms, "rms_mm"), (most, "max_mm")):
        spread = {name: [row[key] for row in rows if row["vehicle"] == name and row[key]] for name in _vehicles(rows)}
        bars(axes, {name: statistics.fmean(values) for name, values in spread.items() if values}, "mm, mean", spread)
    return figure


def _vehicles(rows: Sequence[Row]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(row["vehicle"] for row in rows))

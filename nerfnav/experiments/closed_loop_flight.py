"""What a flight shows: its row of the table, and lists over its time steps."""

from collections.abc import Sequence

import numpy as np

from nerfnav.experiments.estimation_errors import errors_of
from nerfnav.experiments.study import Row
from nerfnav.navigation import NavigationStep
from nerfnav.robots import RigidState

REFUSED = "refused"
"""Outcome where the field has something dense at an end."""
_OFF, _IN_A_ROW = 0.05, 3


def steps_of(flown: Sequence[NavigationStep]) -> Row:
    """Lists over the time steps after the start: errors [m], NEES, whether the truth lies inside the belief's 95 %
    ellipsoid of position, whether the robot holds, and times [ms]."""
    errors = [errors_of(step.belief, step.truth) for step in flown[1:]]
    return {
        "position_m": [error["position_m"] for error in errors],
        "nees": [error["nees"] for error in errors],
        "inside_95": [error["inside_95"] for error in errors],
        "holds": [step.holds for step in flown[1:]],
        "filter_ms": [step.filter_ms for step in flown[1:]],
        "replan_ms": [step.replan_ms for step in flown[1:]],
        "step_ms": [step.filter_ms + step.replan_ms for step in flown[1:]],
    }


def row_of(flown: Sequence[NavigationStep], goal: RigidState, steps: Row) -> Row:
    """The numbers of one flight; None where there are none."""
    last = flown[-1] if flown else None
    outcome = REFUSED if last is None or last.outcome is None else last.outcome.name.lower()
    return {
        "outcome": outcome,
        "steps": len(steps["nees"]),
        "hits_expected": flown[0].hits_expected if flown else None,
        "touches": sum(step.touched for step in flown),
        "final_m": None if last is None else (last.truth.position - goal.position).norm().item(),
        "position_median_m": quantile(steps["position_m"], 0.5),
        "position_p95_m": quantile(steps["position_m"], 0.95),
        "nees_mean": mean(steps["nees"]),
        "inside_95": mean(steps["inside_95"]),
        "silent": is_silent(steps),
        "held": sum(steps["holds"]),
        **times_of(steps),
    }


def times_of(steps: Row) -> Row:
    """Median, 95th percentile and most of the times [ms] of some time steps."""
    return {
        f"{name}_{what}_ms": quantile(steps[f"{name}_ms"], share)
        for name in ("filter", "replan", "step")
        for what, share in (("p50", 0.5), ("p95", 0.95), ("max", 1.0))
    }


def is_silent(steps: Row) -> bool:
    """Silent divergence: for three time steps in a row the believed position is more than 5 cm off, the truth lies
    outside the belief's 95 % ellipsoid, and the robot does not say by holding that it is in doubt."""
    run = 0
    for off, inside, holds in zip(steps["position_m"], steps["inside_95"], steps["holds"], strict=True):
        run = run + 1 if off > _OFF and not inside and not holds else 0
        if run == _IN_A_ROW:
            return True
    return False


def mean(values: Sequence[float]) -> float | None:
    """None of nothing."""
    return float(np.mean(values)) if values else None


def quantile(values: Sequence[float], share: float) -> float | None:
    """A quantile; None of nothing."""
    return float(np.quantile(values, share)) if values else None

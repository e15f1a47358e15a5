"""Plans in words and numbers, as HTML."""

from typing import Any

from app.jobs.events import PlannerResult
from app.page.html import legend, note, table, warning
from app.state.records import PlanRecord
from app.text import capital, number, sentence
from nerfnav.planner import PLANNERS


def compared(comparison: tuple[PlannerResult, ...]) -> str:
    """The numbers of several planners, as HTML."""
    rows = [("planner", "collision · effort · overlap [cm³] · time [s]")]
    for result in comparison:
        if result.motion is None:
            rows.append((result.planner, result.complaint))
            continue
        cost, overlap = result.summary["cost"], result.summary["mesh_overlap_m3"]
        told = "–" if overlap is None else f"{1e6 * overlap:.1f}"
        numbers = f"{cost['collision']:.3g} · {cost['control']:.3g} · {told} · {result.summary['wall_s']:.3g}"
        rows.append((result.planner, numbers))
    found = [result.planner for result in comparison if result.motion is not None]
    lines = legend((PLANNERS[name].color, name) for name in found)
    return table(rows) + lines


def describe(plan: PlanRecord | None, stale: bool, planning: bool) -> str:
    """The numbers of a plan, as HTML."""
    if plan is None or plan.latest is None:
        return note("Looking for a free way…" if planning else "No plan yet: press Plan, and its cost shows here.")
    cost = plan.latest.cost
    rows = [
        ("Iteration", _iteration(plan)),
        ("Cost: collision", number(cost.collision, "")),
        ("Cost: control", number(cost.control, "")),
        ("Cost: total", number(cost.total, "")),
        *_judgement(plan),
    ]
    ended = sentence(plan.outcome.value) if plan.outcome is not None else ""
    words = ended if ended or planning else "Stopped before it had settled."
    remark = warning("Start or goal have moved since: this plan leads to the earlier ones.") if stale else ""
    return table(rows) + (note(words) if words else "") + remark


def _iteration(plan: PlanRecord) -> str:
    shown, latest = plan.shown, plan.latest
    assert shown is not None and latest is not None, "only plans with iterations are described"
    if plan.replayed is None:
        return f"{latest.iteration + 1}"
    return f"{shown.iteration + 1} of {latest.iteration + 1}, shown again slowly"


def _judgement(plan: PlanRecord) -> list[tuple[str, str]]:
    summary, rows = plan.summary, []
    if summary.get("wall_s") is not None:
        rows.append(("Computed in", number(summary["wall_s"], "s")))
    if summary.get("collision_probability_bound") is not None:
        rows.append(("Collision probability at most", number(summary["collision_probability_bound"], "")))
    if summary.get("mesh_overlap_m3") is not None:
        rows.append(("Overlap with the true mesh", number(1e6 * summary["mesh_overlap_m3"], "cm³")))
    if summary.get("max_thrust_n") is not None:
        rows.append(("Largest thrust", number(summary["max_thrust_n"], "N")))
    if summary.get("duration_s") is not None:
        rows.append(("Duration", number(summary["duration_s"], "s")))
    if summary.get("safety", {}).get("min_clearance_m") is not None:
        rows.append(("Least clearance", number(100 * summary["safety"]["min_clearance_m"], "cm")))
    for name, use in summary.get("limits", {}).items():
        rows.append((capital(name.replace("_", " ")), _used(use)))
    return rows


def _used(use: dict[str, Any]) -> str:
    """How much of a limit is used."""
    lower, upper, unit = use["lower"], use["upper"], use["unit"]
    parts = [f"{_rounded(use['least'])} to {number(_rounded(use['most']), unit)}"]
    parts += [f"at least {lower:.3g}"] if lower is not None else []
    parts += [f"at most {upper:.3g}"] if upper is not None else []
    return ", ".join(parts) + (" ✗" if use["violated"] else "")


def _rounded(value: float) -> float:
    return round(value, 3)

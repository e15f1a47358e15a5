"""Plans in words and numbers, as HTML."""

import math
from typing import Any

from nerfnav.planner import GOOD, PLANNERS, CostWeights, PlanOutcome
from nerfnav_app.jobs.events import PlannerResult
from nerfnav_app.page.html import legend, note, table, warning
from nerfnav_app.queries.more_time import MoreTimeQuery
from nerfnav_app.state.records import NOWHERE, PlanRecord
from nerfnav_app.state.session import Session
from nerfnav_app.text import capital, number

_IN_WORDS = {
    PlanOutcome.CONVERGED: "The plan cannot be improved any more.",
    PlanOutcome.ITERATION_LIMIT: "The plan could still be improved.",
    PlanOutcome.NO_PATH: "No way from start to goal was found: move one of them.",
    PlanOutcome.TIME_LIMIT: "No way was found in time: allow more time, or move start or goal.",
    PlanOutcome.IN_COLLISION: "The robot would hit something: move start or goal, or take a smaller robot.",
    PlanOutcome.OVER_LIMITS: "The robot cannot do what this plan asks of it: allow more time.",
    PlanOutcome.TOO_RISKY: "The risk of a hit stays above what you accept: accept more, or move start or goal.",
    PlanOutcome.LIKELY_COLLISION: "The robot is likely to hit something: keep start and goal away from walls and from "
    "what no photograph shows, or take a smaller robot.",
    PlanOutcome.TOUCHES_MESH: "The robot would touch the true surface, which the field does not show well enough: "
    "train it longer, or move start or goal.",
    PlanOutcome.DIVERGED: "The search for a plan failed: allow more time, or restore the weights.",
}


def outcome_in_words(outcome: PlanOutcome) -> str:
    """How planning ended, and what helps, in plain words."""
    return _IN_WORDS[outcome]


def duration_of(plan: PlanRecord) -> float:
    """How long a plan takes [s]."""
    assert plan.latest is not None, "only plans with iterations take any time"
    return len(plan.latest.motion.actions) * plan.latest.motion.dt


def percent(share: float) -> str:
    """An upper bound of a probability as a person reads it, rounded up."""
    tenths = math.ceil(1000 * share - 1e-6)
    return f"{tenths / 10:g} %" if tenths < 100 else f"{math.ceil(100 * share - 1e-6)} %"


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
        none = "No plan yet: press Plan the way, and its cost shows here."
        return note("Looking for a free way…" if planning else none)
    cost = plan.latest.cost
    rows = [
        ("Iteration", _iteration(plan)),
        ("Cost: collision", number(cost.collision, ""), "Sum over time of density × distance travelled (Eq. 2)"),
        ("Cost: effort", number(cost.control, ""), "Control effort: sum of u' Γ u (Eq. 2)"),
        ("Cost: all", number(cost.total, ""), "J"),
        *_judgement(plan),
    ]
    # what is wrong with a plan is said once, in the status line
    words = outcome_in_words(plan.outcome) if plan.outcome in GOOD and plan.outcome is not None else ""
    if plan.outcome is None and not planning:
        words = "Stopped before it was done."
    remark = warning("Something was changed since: this is the earlier plan.") if stale else ""
    return table(rows) + (note(words) if words else "") + remark


def _iteration(plan: PlanRecord) -> str:
    shown, latest = plan.shown, plan.latest
    assert shown is not None and latest is not None, "only plans with iterations are described"
    if plan.replayed is None:
        return f"{latest.iteration + 1}"
    return f"{shown.iteration + 1} of {latest.iteration + 1}, shown again slowly"


def _judgement(plan: PlanRecord) -> list[tuple[str, ...]]:
    summary, rows = plan.summary, list[tuple[str, ...]]()
    if summary.get("wall_s") is not None:
        rows.append(("Computed in", number(summary["wall_s"], "s")))
    if summary.get("collision_probability_bound") is not None:
        risk, term = percent(summary["collision_probability_bound"]), "Upper bound of the collision probability (Eq. 1)"
        rows.append(("Risk of a hit, at most", risk, term))
    if summary.get("mesh_overlap_m3") is not None:
        overlap = number(1e6 * summary["mesh_overlap_m3"], "cm³")
        rows.append(("Overlap with the true surface", overlap, "Largest volume that body and ground-truth mesh share"))
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
    """How much of a limit is used; angles in degrees."""
    scale, unit = (math.degrees(1), use["unit"].replace("rad", "°")) if "rad" in use["unit"] else (1.0, use["unit"])
    least, most = (round(scale * use[end], 3) for end in ("least", "most"))
    parts = [f"{number(least, '')} to {number(most, unit)}"]
    parts += [f"at least {scale * use['lower']:.3g}"] if use["lower"] is not None else []
    parts += [f"at most {scale * use['upper']:.3g}"] if use["upper"] is not None else []
    return ", ".join(parts) + (" ✗" if use["violated"] else "")


def planned(plan: PlanRecord) -> str:
    """How good a plan is, such as "Planned: 2.0 s, 1.2 cm clearance, risk at most 6 %"."""
    parts, safety = [f"Planned: {duration_of(plan):.1f} s"], plan.summary.get("safety", {})
    if safety.get("min_clearance_m") is not None:
        parts.append(f"{100 * safety['min_clearance_m']:.1f} cm clearance")
    if plan.summary.get("collision_probability_bound") is not None:
        parts.append(f"risk at most {percent(plan.summary['collision_probability_bound'])}")
    return ", ".join(parts)


def unsafe(plan: PlanRecord, session: Session) -> str:
    """Why a plan is not to be flown, and what helps."""
    assert plan.outcome is not None, "only a plan that has ended is unsafe"
    if plan.outcome is PlanOutcome.OVER_LIMITS:
        seconds = MoreTimeQuery.seconds_for(plan, session)
        helps = "allow more time" if seconds is None else f"allow {seconds:.1f} s"
        return f"Too fast for {duration_of(plan):.1f} s: {helps}."
    if plan.settings.weights != CostWeights() and plan.outcome not in NOWHERE:
        return f"{outcome_in_words(plan.outcome).split(':')[0]}, with these weights: restore them."
    return outcome_in_words(plan.outcome)

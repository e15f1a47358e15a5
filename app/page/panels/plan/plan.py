"""Plan panel: the planner and its settings, the numbers of the plan, and its charts.

The settings have one widget for each number: duration, accepted risk and weights. The charts show the cost by term
over the iterations, and clearance and risk over time.
"""

import math
from collections.abc import Callable
from dataclasses import fields
from typing import Any

import numpy as np
import viser

from nerfnav.field import UnknownSpace
from nerfnav.navigation import explain_blindness
from nerfnav.planner import FLYABLE, PLANNERS, RISK, CostWeights, PlanOutcome
from nerfnav_app.page.kit.chart import Chart, time_shown
from nerfnav_app.page.kit.html import LegendEntry, caution, note, table, warning
from nerfnav_app.page.kit.risk import look_of_risk, look_of_sigma
from nerfnav_app.page.kit.theme import HIT, STALE, START, TRUTH, readable
from nerfnav_app.page.kit.widgets import Binder, ChoiceList
from nerfnav_app.page.panels.plan.planner_comparison import PlannerComparison
from nerfnav_app.queries.clearance import ClearanceQuery
from nerfnav_app.queries.following_plan import MoreTimeQuery
from nerfnav_app.state.actions import Command, Settings
from nerfnav_app.state.job import JobKind
from nerfnav_app.state.plan import NO_TRAJECTORY, CostHistory, PlanRecord
from nerfnav_app.state.session import Session
from nerfnav_app.text import capital, number

_OUTCOMES = {
    PlanOutcome.CONVERGED: "The optimisation has converged.",
    PlanOutcome.ITERATION_LIMIT: "The optimisation stopped at its iteration limit.",
    PlanOutcome.NO_PATH: "No path from start to goal was found: move one of them.",
    PlanOutcome.TIME_LIMIT: "No path was found in time: allow more time, or move start or goal.",
    PlanOutcome.IN_COLLISION: "The robot would hit something: move start or goal, or select a smaller robot.",
    PlanOutcome.OVER_LIMITS: "The plan exceeds the robot's limits: allow more time.",
    PlanOutcome.TOO_RISKY: "The collision risk exceeds the accepted one: accept more, or move start or goal.",
    PlanOutcome.LIKELY_COLLISION: "The robot will probably collide: move start and goal away from walls and unseen "
    "space, or select a smaller robot.",
    PlanOutcome.TOUCHES_MESH: "The robot would touch the true surface, which the field misses: train the field "
    "longer, or move start or goal.",
    PlanOutcome.DIVERGED: "The optimisation diverged: allow more time, or restore the weights.",
}


_NO_PLAN = "No plan yet. Press Plan trajectory: its cost is shown here."


def describe_outcome(outcome: PlanOutcome) -> str:
    """Describe the outcome of planning, and the remedy."""
    return _OUTCOMES[outcome]


def duration_of(plan: PlanRecord) -> float:
    """Compute the duration of a plan [s]."""
    assert plan.latest is not None, "only plans with iterations have a duration"
    return len(plan.latest.motion.actions) * plan.latest.motion.dt


def percent(share: float) -> str:
    """Format an upper bound of a probability, rounded up."""
    tenths = math.ceil(1000 * share - 1e-6)
    return f"{tenths / 10:g} %" if tenths < 100 else f"{math.ceil(100 * share - 1e-6)} %"


def describe_flown(session: Session) -> str:
    """Format the numbers of the plan in flight at the time that is shown as HTML."""
    flight, clearance = session.shown_flight, ClearanceQuery.result_shown(session)
    assert flight is not None and flight.steps, "only a flight that is shown has a plan in flight"
    last = flight.steps[-1]
    rows = [
        ("Plan of the flight at", number(last.time, "s"), "The robot plans again in each time step"),
        ("Time to the end", number(len(last.plan.actions) * last.plan.dt, "s")),
    ]
    if clearance is not None and clearance.smallest_m is not None:
        rows.append(("Minimum clearance", number(100 * clearance.smallest_m, "cm")))
        rows.append(("Bound of Eq. 1", percent(clearance.bound), _BOUND))
    remark = caution(f"{OLD} {session.flight_outdated_by}.") if session.flight_outdated_by else ""
    return remark + table(rows) + (warning(f"{OLD_GOAL}.") if holds_old_goal(session) else "")


OLD = "Flown with the old"
"""Mark of the numbers of a flight after its settings or its field were replaced."""
OLD_GOAL = "The plan leads to the old goal until you resume"
"""Remark on a paused flight whose goal was moved."""

_BOUND = "Upper bound of the collision probability by Eq. 1 of the paper, which counts every body point alone"

_SIGMA = "Median over the plan of the standard deviation of the estimated position, by what the camera will see"


def holds_old_goal(session: Session) -> bool:
    """Check whether a paused flight still has the plan to the goal before."""
    flight, job = session.flight, session.job
    return session.in_flight and job is not None and job.paused and flight is not None and flight.leads_to_old_goal


def describe(plan: PlanRecord | None, stale: bool, planning: bool, in_draft: bool = False) -> str:
    """Format the numbers of a plan, in a field that is a draft or trained, as HTML."""
    if plan is None or plan.latest is None:
        return note("Searching for a free path…" if planning else _NO_PLAN)
    cost = plan.latest.cost
    rows = [
        ("Iteration", _iteration(plan)),
        ("Cost: collision", number(cost.collision, ""), "Sum over time of density × distance travelled (Eq. 2)"),
        ("Cost: control", number(cost.control, ""), "Control effort: sum of u' Γ u (Eq. 2)"),
        ("Cost: total", number(cost.total, ""), "J"),
        *_judgement(plan),
    ]
    # the status line has the fault of an unsafe plan
    outcome = describe_outcome(plan.outcome) if plan.outcome in FLYABLE and plan.outcome is not None else ""
    if plan.outcome is None and not planning:
        outcome = "Stopped before it was finished."
    remark = warning("Ends, settings or the field have changed since this plan.") if stale else ""
    if plan.is_blind and plan.expected_sigma is not None:
        remark = caution(f"{capital(explain_blindness(plan.expected_sigma.blind_share, in_draft=in_draft))}.") + remark
    return table(rows) + (note(outcome) if outcome else "") + remark


def _iteration(plan: PlanRecord) -> str:
    shown, latest = plan.shown, plan.latest
    assert shown is not None and latest is not None, "only plans with iterations are described"
    if plan.replayed is None:
        return f"{latest.iteration + 1}"
    return f"{shown.iteration + 1} of {latest.iteration + 1}, replay"


def _judgement(plan: PlanRecord) -> list[tuple[str, ...]]:
    summary, rows = plan.summary, list[tuple[str, ...]]()
    if summary.get("wall_s") is not None:
        rows.append(("Computed in", number(summary["wall_s"], "s")))
    if plan.collision_probability is not None:
        look = look_of_risk(plan.collision_probability)
        rows.append(("Collision risk", look.text, "Probability that a flight by this plan hits", readable(look.color)))
    if plan.expected_sigma is not None:
        look = look_of_sigma(plan.expected_sigma)
        rows.append(("Expected sigma", look.text, _SIGMA, readable(look.color)))
    if summary.get("collision_probability_bound") is not None:
        rows.append(("Bound of Eq. 1", percent(summary["collision_probability_bound"]), _BOUND))
    if summary.get("mesh_overlap_m3") is not None:
        overlap = number(1e6 * summary["mesh_overlap_m3"], "cm³")
        rows.append(("Overlap with the true mesh", overlap, "Largest volume that body and ground-truth mesh share"))
    known = (
        ("Peak thrust", summary.get("max_thrust_n"), 1, "N"),
        ("Duration", summary.get("duration_s"), 1, "s"),
        ("Minimum clearance", summary.get("safety", {}).get("min_clearance_m"), 100, "cm"),
    )
    rows += [(name, number(scale * value, unit)) for name, value, scale, unit in known if value is not None]
    limits = summary.get("limits", {})
    return rows + [(capital(name.replace("_", " ")), _used(use)) for name, use in limits.items()]


def _used(use: dict[str, Any]) -> str:
    """Format the used part of a limit; angles in degrees."""
    scale, unit = (math.degrees(1), use["unit"].replace("rad", "°")) if "rad" in use["unit"] else (1.0, use["unit"])
    least, most = (round(scale * use[end], 3) for end in ("least", "most"))
    parts = [f"{number(least, '')} to {number(most, unit)}"]
    parts += [f"at least {scale * use['lower']:.3g}"] if use["lower"] is not None else []
    parts += [f"at most {scale * use['upper']:.3g}"] if use["upper"] is not None else []
    return ", ".join(parts) + (" ✗" if use["violated"] else "")


def summarize_plan(plan: PlanRecord) -> str:
    """Summarize a plan, such as "Planned: 2.0 s, 1.2 cm clearance, collision risk 0.6 %, low"."""
    parts, safety = [f"Planned: {duration_of(plan):.1f} s"], plan.summary.get("safety", {})
    if safety.get("min_clearance_m") is not None:
        parts.append(f"{100 * safety['min_clearance_m']:.1f} cm clearance")
    if plan.collision_probability is not None:
        parts.append(f"collision risk {look_of_risk(plan.collision_probability).text}")
    if plan.is_blind and plan.expected_sigma is not None:
        parts.append(f"expected sigma {look_of_sigma(plan.expected_sigma).text}")
    return ", ".join(parts)


def explain_unsafe_plan(plan: PlanRecord, session: Session) -> str:
    """Explain why a plan is not to be flown unasked, and name the remedy."""
    assert plan.outcome is not None, "only a plan that has ended is unsafe"
    if plan.is_risky and plan.is_good and plan.collision_probability is not None:
        risk = look_of_risk(plan.collision_probability).text
        return f"The collision risk is {risk}: move start and goal away from obstacles, or raise the risk weight."
    if plan.is_good and plan.expected_sigma is not None:
        return f"{capital(explain_blindness(plan.expected_sigma.blind_share, in_draft=True))}."
    if plan.outcome is PlanOutcome.OVER_LIMITS:
        seconds = MoreTimeQuery.result_for(plan, session)
        remedy = "allow more time" if seconds is None else f"allow {seconds:.1f} s"
        return f"Too fast for {duration_of(plan):.1f} s: {remedy}."
    if not plan.settings.has_default_cost and plan.outcome not in NO_TRAJECTORY:
        return f"{describe_outcome(plan.outcome).split(':')[0]}, with these weights: restore them."
    return describe_outcome(plan.outcome)


_LEAST_COST = 1e-3  # lower end of the logarithmic axis
_LEAST_RISK = 0.01  # [%], of the top of its axis: a step with less is safe
_NO_HISTORY = CostHistory()
_TERMS = (
    LegendEntry((235, 237, 243), "total"), LegendEntry(TRUTH, "control"), LegendEntry(HIT, "collision"),
    LegendEntry(STALE, "limits"),
)  # fmt: skip


class PlanCharts:
    """Charts of a plan, hidden while there is nothing to draw."""

    def __init__(self, server: viser.ViserServer) -> None:
        """Add the charts to the panel."""
        self._cost = Chart(server, "iteration", _TERMS, logarithmic=True)
        self._clearance = Chart(server, "time [s]", (LegendEntry(START, "clearance [cm]"),))
        self._risk = Chart(server, "time [s]", (LegendEntry(HIT, "bound of Eq. 1 by step [%]"),), least_top=_LEAST_RISK)
        self._history: CostHistory | None = None

    def show(self, session: Session) -> None:
        """Draw the plan, or that of the flight which is shown; one that follows a drag is drawn once the drag ends."""
        if session.held:
            return
        history = _NO_HISTORY if session.plan is None or session.flight_is_shown else session.plan.history
        if history is not self._history:
            self._history = history
            self._cost.show(chart_data(history))
        known = ClearanceQuery.result_shown(session)
        rows = np.zeros((3, 0)) if known is None else known.rows
        at = time_shown(session)
        self._clearance.show(rows[[0, 1]], at)
        self._risk.show(rows[[0, 2]], at)


def chart_data(history: CostHistory) -> np.ndarray:
    """Build rows: iterations, then total, control, collision and limits at each; floored for the logarithmic axis."""
    terms = [(cost.total, cost.control, cost.collision, cost.limits) for cost in history.costs]
    rows = np.maximum(np.array(terms, dtype=np.float64).reshape(-1, 4), _LEAST_COST).T
    return np.concatenate([np.array(history.iterations, dtype=np.float64)[None], rows])


_PLANNERS = "fast: seconds; minsnap: minimum snap; rrt: random tree; paper: Eq. 2 by gradient descent, minutes"
_UNITS = {"outside": "1/m²", "margin": "m"}
_HINTS = {
    "collision": "Of density × distance travelled, summed over body points and time (Eq. 2)",
    "control": "Of the control effort u' Γ u (Eq. 2)",
    "limits": "Of the squared excess over the robot's limits",
    "outside": "Of the squared distance by which the body is outside of the place [m²]: the cost has no unit",
    "samples_per_step": "Points on the path through a step at which densities are taken",
    "margin": "Room around the body that is planned as if it were part of it",
}


class PlanSettingsWidgets:
    """Widgets of `PlanSettings`; those of the weights follow the fields of their record."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """Add the widgets; `post` takes the commands."""
        gui = server.gui
        self._duration = gui.add_number("Duration [s]", 2.0, step=0.1, hint="From start to goal, rest to rest")
        self._shortest = gui.add_checkbox(
            "Find the shortest duration", False, hint="Minimum time within the robot's limits"
        )
        self._accepted = gui.add_number(
            "Accepted risk [%]", 100.0, step=0.1, hint="A plan whose bound of Eq. 1 is larger is refused; 100: none is"
        )
        self._free = gui.add_checkbox(
            "Unseen space is free", False, hint="Plan through space that nothing shows; else it counts as solid"
        )
        bind, weigh = Binder(Settings.PLAN, post), Binder(Settings.WEIGHTS, post)
        bind(self._duration, "duration_s", float)
        bind(self._shortest, "shortest", bool)
        bind(self._accepted, "max_collision", lambda percent: None if percent >= 100 else 0.01 * float(percent))
        bind(self._free, "unknown", lambda free: UnknownSpace.FREE if free else UnknownSpace.OCCUPIED)
        self._weights: dict[str, viser.GuiInputHandle[Any]] = {}
        with gui.add_folder("Weights", expand_by_default=False):
            self._paper_cost = gui.add_checkbox(
                "Paper's cost alone", False, hint="Minimise Eq. 2 of the paper: no noise model, no room for noise"
            )
            bind(self._paper_cost, "paper_cost", bool)
            self._risk = gui.add_number(
                "Risk weight [J]", RISK, hint="Cost of a collision by noise: more keeps farther from obstacles"
            )
            bind(self._risk, "risk_weight", float)
            for part in fields(CostWeights):
                if part.name == "risk":
                    continue  # which is `risk_weight`
                name = capital(part.name.replace("_", " "))
                unit = f" [{_UNITS[part.name]}]" if part.name in _UNITS else ""
                self._weights[part.name] = widget = gui.add_number(
                    name + unit, getattr(CostWeights(), part.name), hint=_HINTS[part.name]
                )
                weigh(widget, part.name, type(getattr(CostWeights(), part.name)))

    def show(self, session: Session) -> None:
        """Copy the session's settings into the widgets."""
        settings = session.plan_settings
        self._duration.value, self._shortest.value = settings.duration_s, settings.shortest
        accepted = settings.max_collision
        self._accepted.value = 100.0 if accepted is None else round(100 * accepted, 6)
        self._free.value = settings.unknown is UnknownSpace.FREE
        self._paper_cost.value, self._risk.value = settings.paper_cost, settings.weights.risk or settings.risk_weight
        for name, widget in self._weights.items():
            widget.value = getattr(settings.weights, name)


class PlanPanel:
    """Panel of the plan: planner, settings, numbers and charts."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """Add the widgets; `post` takes the commands."""
        self._planner = ChoiceList(server, "planner", PLANNERS, _PLANNERS, post)
        self._comparison = PlannerComparison(server, post)
        self._numbers = server.gui.add_html(note(_NO_PLAN))
        self._charts = PlanCharts(server)
        self._margin = server.gui.add_checkbox(
            "Room for noise", True, hint="Draw the body's radius and two standard deviations by noise around the plan"
        )
        Binder(Settings.VIEW, post)(self._margin, "margin", bool)
        self._settings = PlanSettingsWidgets(server, post)

    def show(self, session: Session) -> None:
        """Show the plan as far as it is computed."""
        self._planner.show(session)
        self._settings.show(session)
        planning = session.job is not None and session.job.kind in (JobKind.PLAN, JobKind.COMPARE)
        self._margin.value = session.view_settings.margin
        self._numbers.content = (
            describe_flown(session)
            if session.flight_is_shown
            else describe(session.plan, session.plan_is_stale, planning, session.in_draft)
        )
        self._comparison.show(session)
        self._charts.show(session)

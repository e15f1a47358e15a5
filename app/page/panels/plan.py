"""Ask for a plan, and watch its cost fall."""

from collections.abc import Callable
from typing import Any

import numpy as np
import viser

from app.jobs.events import PlannerResult
from app.page.html import legend, note, table, warning
from app.page.panels.chart import Chart
from app.page.panels.dropdown import ChoiceList
from app.page.panels.plan_settings import PlanningPanel
from app.page.theme import HIT, STALE, START, TRUTH
from app.queries.clearance import ClearanceQuery
from app.state.actions import Cancel, Command, StartComparison, StartPlan
from app.state.records import CostHistory, PlanRecord
from app.state.session import JobKind, Session
from app.text import capital, number, sentence
from nerfnav.planner.planners import PLANNERS

_LEAST_COST = 1e-3  # of what the logarithmic axis shows
_TERMS = (((235, 237, 243), "total"), (TRUTH, "control"), (HIT, "collision"), (STALE, "limits"))


class PlanPanel:
    """The button, the cost by term over the iterations, and the numbers of the plan."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """`post` takes what the user asks."""
        self._planner = ChoiceList(server, "planner", PLANNERS, "How the trajectory is found", post)
        self._plan = server.gui.add_button("Plan", icon=viser.Icon.ROUTE, disabled=True)
        self._cancel = server.gui.add_button("Cancel", color="gray", icon=viser.Icon.X, visible=False)
        self._compare = server.gui.add_button(
            "Compare planners", color="gray", icon=viser.Icon.SCALE, disabled=True,
            hint="Fast, minimum snap, RRT, then the paper's: between the same ends",
        )  # fmt: skip
        self._numbers = server.gui.add_html(note("No plan yet: press Plan, and its cost shows here."))
        self._comparison = server.gui.add_html("", visible=False)
        self._chart = Chart(server, "iteration", _TERMS, logarithmic=True)
        self._room = Chart(server, "time [s]", ((START, "clearance [cm]"),))
        self._risk = Chart(server, "time [s]", ((HIT, "bound on the probability of a collision [%]"),))
        self._settings = PlanningPanel(server, post)
        self._history: CostHistory | None = None

        @self._compare.on_click
        async def _(_: viser.GuiEvent) -> None:
            post(StartComparison())

        @self._plan.on_click
        async def _(_: viser.GuiEvent) -> None:
            post(StartPlan())

        @self._cancel.on_click
        async def _(_: viser.GuiEvent) -> None:
            post(Cancel())

    def show(self, session: Session) -> None:
        """Show the plan as far as it is."""
        self._planner.show(session)
        self._settings.show(session)
        planning = session.job is not None and session.job.kind in (JobKind.PLAN, JobKind.COMPARE)
        self._plan.disabled = self._compare.disabled = not session.may_begin
        self._plan.visible, self._cancel.visible = not planning, planning
        plan = session.plan
        self._draw(plan.history if plan is not None else CostHistory())
        self._numbers.content = describe(plan, session.plan_is_stale, planning)
        self._comparison.visible = bool(session.comparison)
        if session.comparison:
            self._comparison.content = compared(session.comparison)
        self._near(session)

    def _near(self, session: Session) -> None:
        known = ClearanceQuery.rows_of(session.plan, session)
        rows = np.zeros((3, 0)) if known is None else known
        self._room.show(rows[[0, 1]])
        self._risk.show(rows[[0, 2]])

    def _draw(self, history: CostHistory) -> None:
        if history is self._history:
            return
        self._history = history
        self._chart.show(chart_data(history))


def chart_data(history: CostHistory) -> np.ndarray:
    """Rows: iterations, then total, control, collision and limits at each; floored for the logarithmic axis."""
    terms = [(cost.total, cost.control, cost.collision, cost.limits) for cost in history.costs]
    rows = np.maximum(np.array(terms, dtype=np.float64).reshape(-1, 4), _LEAST_COST).T
    return np.concatenate([np.array(history.iterations, dtype=np.float64)[None], rows])


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

"""Ask for a plan, and watch its cost fall."""

from collections.abc import Callable

import numpy as np
import viser
from viser import uplot

from app.messages import Cancel, Command, StartPlan
from app.panels.choice import ChoiceList
from app.records import CostHistory, PlanRecord
from app.registry import PLANNERS
from app.session import JobKind, Session
from app.theme import HIT, STALE, TRUTH, css
from app.widgets import legend, note, number, table, warning

_LEAST_COST = 1e-3  # of what the logarithmic axis shows
_TERMS = (((235, 237, 243), "total"), (TRUTH, "control"), (HIT, "collision"), (STALE, "limits"))


class PlanPanel:
    """The button, the cost by term over the iterations, and the numbers of the plan."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """`post` takes what the user asks."""
        self._planner = ChoiceList(server, "planner", PLANNERS, "How the trajectory is found", post)
        self._plan = server.gui.add_button("Plan", icon=viser.Icon.ROUTE, disabled=True)
        self._cancel = server.gui.add_button("Cancel", color="gray", icon=viser.Icon.X, visible=False)
        self._chart = _add_chart(server)
        self._terms = server.gui.add_html(legend(_TERMS), visible=False)
        self._numbers = server.gui.add_html(note("No plan yet: press Plan, and its cost shows here."))
        self._history: CostHistory | None = None

        @self._plan.on_click
        async def _(_: viser.GuiEvent) -> None:
            post(StartPlan())

        @self._cancel.on_click
        async def _(_: viser.GuiEvent) -> None:
            post(Cancel())

    def show(self, session: Session) -> None:
        """Show the plan as far as it is."""
        self._planner.show(session)
        planning = session.job is not None and session.job.kind is JobKind.PLAN
        self._plan.disabled = session.place is None or session.job is not None
        self._plan.visible, self._cancel.visible = not planning, planning
        plan = session.plan
        self._draw(plan.history if plan is not None else CostHistory())
        self._numbers.content = describe(plan, session.plan_is_stale, planning)

    def _draw(self, history: CostHistory) -> None:
        if history is self._history:
            return
        self._history = history
        if len(history.iterations) > 1:
            self._chart.data = chart_data(history)
        self._chart.visible = self._terms.visible = len(history.iterations) > 1


def chart_data(history: CostHistory) -> tuple[np.ndarray, ...]:
    """Iterations, then total, control, collision and limits at each; floored for the logarithmic axis."""
    terms = [(cost.total, cost.control, cost.collision, cost.limits) for cost in history.costs]
    columns = np.maximum(np.array(terms, dtype=np.float64), _LEAST_COST).T
    return np.array(history.iterations, dtype=np.float64), *columns


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
    ended = plan.outcome.value.capitalize() + "." if plan.outcome is not None else ""
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
    return rows


def _add_chart(server: viser.ViserServer) -> viser.GuiUplotHandle:
    start = np.array([0.0, 1.0])
    series = [uplot.Series(label="iteration")]
    series += [uplot.Series(label=name, stroke=css(color), width=1.75) for color, name in _TERMS]
    quiet = uplot.Axis_Ticks(show=False)
    return server.gui.add_uplot(
        (start, *(start + _LEAST_COST for _ in _TERMS)),
        tuple(series),
        scales={"x": uplot.Scale(time=False), "y": uplot.Scale(distr=3)},
        axes=(uplot.Axis(size=26, ticks=quiet), uplot.Axis(size=44, ticks=quiet)),
        legend=uplot.Legend(show=False),
        padding=(10, 12, 0, 0),
        height=170,
        visible=False,
    )

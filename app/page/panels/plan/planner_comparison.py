"""Comparison of planners: a table of their plans, whose rows highlight the lines in the scene."""

from collections.abc import Callable

import viser

from nerfnav.planner import FLYABLE, PLANNERS, PlanOutcome
from nerfnav_app.jobs.events import PlannerResult
from nerfnav_app.page.kit.data_table import Column, Picks, Row, Text, data_table
from nerfnav_app.page.kit.theme import HIT
from nerfnav_app.page.kit.widgets import post_on
from nerfnav_app.state.actions import Command
from nerfnav_app.state.plan import EndComparison, HighlightPlanner, StartComparison
from nerfnav_app.state.session import Session
from nerfnav_app.text import number

ALL = "all"
"""Choice that highlights no line."""
_HOVER = "hover:"
"""Beginning of the picks by the pointer over a row."""
_COLUMNS = (
    Column((Text("Planner"),)),
    Column((Text("Collision"), Text("[J]", muted=True)), number=True),
    Column((Text("Control"), Text("[J]", muted=True)), number=True),
    Column((Text("Overlap", hint="Largest volume that body and ground-truth mesh share"), Text("[cm³]", muted=True)),
           number=True),
    Column((Text("Flight", hint="Duration from start to goal"), Text("[s]", muted=True)), number=True),
    Column((Text("Solve", hint="Computing time"), Text("[s]", muted=True)), number=True),
)  # fmt: skip


class PlannerComparison:
    """Widgets of the comparison: a button that starts it, its table, and the choice of a highlighted line."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """Add the widgets; `post` takes the commands."""
        self._post = post
        self._pinned = ALL
        gui = server.gui
        self._compare = gui.add_button(
            "Compare planners", color="gray", icon=viser.Icon.SCALE, disabled=True,
            hint=f"Plan between the same ends with {', '.join(PLANNERS)}",
        )  # fmt: skip
        self._table = gui.add_html("", visible=False)
        self._picks = Picks(server, self._pick)
        self._highlight: viser.GuiDropdownHandle[str] = gui.add_dropdown(
            "Highlight", [ALL], visible=False, hint="Draw this planner's line stronger; or point at its row"
        )
        self._end = gui.add_button("End planner comparison", color="gray", icon=viser.Icon.X, visible=False)
        post_on(self._compare.on_click, post, StartComparison)
        post_on(self._highlight.on_update, post, self._choose)
        post_on(self._end.on_click, post, EndComparison)

    def _choose(self) -> HighlightPlanner:
        self._pinned = str(self._highlight.value)
        return HighlightPlanner(None if self._pinned == ALL else self._pinned)

    def _pick(self, value: str) -> None:
        """Highlight by a click into the table, again to end it; or while the pointer is over a row."""
        if value in self._highlight.options:
            self._pinned = ALL if value == self._pinned else value
        hovered = value.removeprefix(_HOVER) if value.startswith(_HOVER) else ""
        name = hovered or self._pinned
        self._post(HighlightPlanner(name if name in PLANNERS else None))

    def show(self, session: Session) -> None:
        """Show the results of the comparison, as far as it has come."""
        self._compare.disabled = not session.may_begin
        there = bool(session.comparison)
        self._table.visible = self._highlight.visible = there
        self._end.visible = there and session.job is None
        options = (ALL, *(result.planner for result in session.comparison if result.motion is not None))
        if self._highlight.options != options:
            self._highlight.options = options
        if self._pinned not in options:
            self._pinned = ALL
        self._highlight.value = self._pinned
        if there:
            self._table.content = describe_comparison(session.comparison, self._pinned, self._picks.id)


def describe_comparison(comparison: tuple[PlannerResult, ...], pinned: str = ALL, picks: str = "") -> str:
    """Format the results of several planners as a table in HTML."""
    table = data_table(_COLUMNS, [_row(result, pinned) for result in comparison if result.motion is not None], picks)
    refused = [result for result in comparison if result.motion is None]
    if not refused:
        return table
    reasons = [Row(((Text(result.planner),), (Text(result.complaint, HIT),))) for result in refused]
    return table + data_table((Column((Text("Planner"),)), Column((Text("No plan"),))), reasons)


def _row(result: PlannerResult, pinned: str) -> Row:
    summary, name = result.summary, result.planner
    cost, overlap, duration = summary["cost"], summary["mesh_overlap_m3"], summary.get("duration_s")
    cells = (
        (Text(name, dot=PLANNERS[name].color), *_fault(result)),
        (Text(number(cost["collision"], "", digits=2)),),
        (Text(number(cost["control"], "")),),
        (Text("–" if overlap is None else f"{1e6 * overlap:.1f}"),),
        (Text("–" if duration is None else number(duration, "")),),
        (Text(number(summary["wall_s"], "")),),
    )
    return Row(cells, name, name == pinned, _HOVER + name, _HOVER)


def _fault(result: PlannerResult) -> tuple[Text, ...]:
    """Name the outcome of a plan that is not to be flown, below its planner."""
    outcome = result.summary.get("outcome")
    if outcome is None or PlanOutcome[outcome.upper()] in FLYABLE:
        return ()
    return (Text(outcome.replace("_", " "), HIT),)

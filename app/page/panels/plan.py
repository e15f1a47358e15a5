"""Ask for a plan, and watch its cost fall."""

from collections.abc import Callable

import viser

from app.page.html import note
from app.page.panels.dropdown import ChoiceList
from app.page.panels.plan_charts import PlanCharts
from app.page.panels.plan_settings import PlanningPanel
from app.page.panels.plan_words import compared, describe
from app.state.actions import Cancel, Command, StartComparison, StartPlan
from app.state.job import JobKind
from app.state.session import Session
from nerfnav.planner import PLANNERS


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
        self._charts = PlanCharts(server)
        self._settings = PlanningPanel(server, post)

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
        self._numbers.content = describe(session.plan, session.plan_is_stale, planning)
        self._comparison.visible = bool(session.comparison)
        if session.comparison:
            self._comparison.content = compared(session.comparison)
        self._charts.show(session)

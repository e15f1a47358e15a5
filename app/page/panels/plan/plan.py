"""How a plan is made, and how its cost falls."""

from collections.abc import Callable

import viser

from nerfnav.planner import PLANNERS
from nerfnav_app.page.kit.html import note
from nerfnav_app.page.panels.dropdown import ChoiceList
from nerfnav_app.page.panels.plan_charts import PlanCharts
from nerfnav_app.page.panels.plan_settings import PlanningPanel
from nerfnav_app.page.panels.plan_words import compared, describe
from nerfnav_app.state.actions import Command, StartComparison
from nerfnav_app.state.job import JobKind
from nerfnav_app.state.session import Session


class PlanPanel:
    """The planner, the cost by term over the iterations, and the numbers of the plan."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """`post` takes what the user asks."""
        self._planner = ChoiceList(server, "planner", PLANNERS, "How the trajectory is found", post)
        self._compare = server.gui.add_button(
            "Compare planners", color="gray", icon=viser.Icon.SCALE, disabled=True,
            hint="Fast, minimum snap, RRT, then the paper's: between the same ends",
        )  # fmt: skip
        self._numbers = server.gui.add_html(note("No plan yet: press Plan the way, and its cost shows here."))
        self._comparison = server.gui.add_html("", visible=False)
        self._charts = PlanCharts(server)
        self._settings = PlanningPanel(server, post)

        @self._compare.on_click
        async def _(_: viser.GuiEvent) -> None:
            post(StartComparison())

    def show(self, session: Session) -> None:
        """Show the plan as far as it is."""
        self._planner.show(session)
        self._settings.show(session)
        planning = session.job is not None and session.job.kind in (JobKind.PLAN, JobKind.COMPARE)
        self._compare.disabled = not session.may_begin
        self._numbers.content = describe(session.plan, session.plan_is_stale, planning)
        self._comparison.visible = bool(session.comparison)
        if session.comparison:
            self._comparison.content = compared(session.comparison)
        self._charts.show(session)

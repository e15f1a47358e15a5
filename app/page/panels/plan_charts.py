"""Charts of a plan: its cost over the iterations, its clearance and its risk over time."""

import numpy as np
import viser

from nerfnav_app.page.panels.chart import Chart
from nerfnav_app.page.panels.flight_charts import time_shown
from nerfnav_app.page.theme import HIT, STALE, START, TRUTH
from nerfnav_app.queries.clearance import ClearanceQuery
from nerfnav_app.state.records import CostHistory
from nerfnav_app.state.session import Session

_LEAST_COST = 1e-3  # of what the logarithmic axis shows
_TERMS = (((235, 237, 243), "total"), (TRUTH, "control"), (HIT, "collision"), (STALE, "limits"))


class PlanCharts:
    """Hidden while there is nothing to draw."""

    def __init__(self, server: viser.ViserServer) -> None:
        """Put the charts up below what is there."""
        self._cost = Chart(server, "iteration", _TERMS, logarithmic=True)
        self._room = Chart(server, "time [s]", ((START, "clearance [cm]"),))
        self._risk = Chart(server, "time [s]", ((HIT, "risk of a hit in a step, at most [%]"),))
        self._history: CostHistory | None = None

    def show(self, session: Session) -> None:
        """Draw the plan of the session; one that follows a hand is drawn once the hand lets go."""
        if session.held:
            return
        history = session.plan.history if session.plan is not None else CostHistory()
        if history is not self._history:
            self._history = history
            self._cost.show(chart_data(history))
        known = ClearanceQuery.rows_of(session.plan, session)
        rows = np.zeros((3, 0)) if known is None else known
        at = time_shown(session)
        self._room.show(rows[[0, 1]], at)
        self._risk.show(rows[[0, 2]], at)


def chart_data(history: CostHistory) -> np.ndarray:
    """Rows: iterations, then total, control, collision and limits at each; floored for the logarithmic axis."""
    terms = [(cost.total, cost.control, cost.collision, cost.limits) for cost in history.costs]
    rows = np.maximum(np.array(terms, dtype=np.float64).reshape(-1, 4), _LEAST_COST).T
    return np.concatenate([np.array(history.iterations, dtype=np.float64)[None], rows])

"""Compared flight: path, robot and plan of a second flight at the same time after take-off."""

import viser

from nerfnav.navigation import NavigationStep
from nerfnav.robots import RigidState
from nerfnav_app.page.kit.theme import OTHER_PLAN, OTHER_TRUTH
from nerfnav_app.page.layers.nodes import Bodies, Line, positions
from nerfnav_app.state.flight import FlightRecord
from nerfnav_app.state.runs import StoredFlight
from nerfnav_app.state.session import Session


class ComparisonLayer:
    """Layer of the second flight of a comparison, in another shade."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._truth = Line(server, "/compared/truth", OTHER_TRUTH, 0.012)
        self._plan = Line(server, "/compared/plan", OTHER_PLAN, 0.009)
        self._robot = Bodies(server, "/compared/robot", OTHER_TRUTH, opacity=0.8)
        self._shown: tuple[StoredFlight | None, int] | None = None

    def show(self, session: Session) -> None:
        """Draw the second flight as far as the first one is shown."""
        compared = None if session.compares_planners else session.runs.compared
        steps = steps_until(compared, session.shown_flight)
        shown = compared, len(steps)
        if shown == self._shown:
            return
        self._shown = shown
        with self._server.atomic():
            self._robot.embody(session)
            path = positions(RigidState.stack([step.truth for step in steps])) if len(steps) > 1 else None
            self._truth.show(path)
            under_way = compared is not None and 0 < len(steps) < len(compared.record.steps)
            self._plan.show(positions(steps[-1].plan.states) if steps and under_way else None)
            self._robot.show_states(RigidState.stack([steps[-1].truth]) if steps else None)


def steps_until(compared: StoredFlight | None, shown: FlightRecord | None) -> tuple[NavigationStep, ...]:
    """Cut the second flight at the time that the first one shows; all steps without a first one."""
    if compared is None:
        return ()
    steps = compared.record.steps
    if shown is None or not shown.steps:
        return steps
    until = shown.steps[-1].time + 1e-6
    return tuple(step for step in steps if step.time <= until)

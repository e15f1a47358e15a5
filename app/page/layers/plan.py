"""The plan: its line as it is now, a few earlier iterations, and the body along it."""

import numpy as np
import viser

from app.jobs.events import PlannerResult
from app.page.layers.nodes import Bodies, Line, Trail, positions, quaternions
from app.page.layers.shapes import robot_shape
from app.page.theme import PLAN, STALE
from app.state.records import PlanRecord
from app.state.session import Session
from nerfnav.planner import PLANNERS
from nerfnav.robots import Motion, Robot

_THICKNESS = 0.017  # [m]


class PlanLayer:
    """Shows the iterations of a plan as they are computed."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._line = Line(server, "/plan/line", PLAN, _THICKNESS)
        self._trail = Trail(server, "/plan/trail", PLAN, 0.5 * _THICKNESS)
        self._bodies = Bodies(server, "/plan/bodies", robot_shape((0.1, 0.1, 0.04)), PLAN, opacity=0.35)
        self._comparison = {
            name: Line(server, f"/plan/{name}", entry.color, 0.008) for name, entry in PLANNERS.items()
        }
        self._compared: tuple[PlannerResult, ...] = ()
        self._robot: Robot | None = None
        self._shown: tuple[int, bool, bool] | None = None

    def show(self, session: Session) -> None:
        """Draw the plan; greyed where the ends have moved since, hidden where a flight shows its own."""
        self._compare(session.comparison)
        flying = session.flight is not None and bool(session.flight.steps)
        plan = None if flying else session.plan
        stale, busy = session.plan_is_stale, session.job is not None
        if self._shown == (id(plan), stale, busy):
            return
        self._shown = id(plan), stale, busy
        if session.place is not None and self._robot is not session.place.robot:
            self._robot = session.place.robot
            self._bodies.shape(robot_shape(self._robot.body.extents))
        step, replaying = (None, False) if plan is None else (plan.shown, plan.replayed is not None)
        motion = None if step is None else step.motion
        with self._server.atomic():
            self._line.show(None if motion is None else positions(motion.states), STALE if stale else PLAN)
            self._trail.show(_beside(plan, moving=busy or replaying) if plan is not None and not stale else ())
            bodies = motion if motion is not None and not (busy or replaying or stale) else None
            if bodies is None:
                self._bodies.show(np.zeros((0, 3)), np.zeros((0, 4)))
            else:
                self._bodies.show(positions(bodies.states), quaternions(bodies.states))

    def _compare(self, comparison: tuple[PlannerResult, ...]) -> None:
        """Draw the plans of a comparison."""
        if comparison is self._compared:
            return
        self._compared = comparison
        motions = {result.planner: result.motion for result in comparison}
        for name, line in self._comparison.items():
            motion = motions.get(name)
            line.show(None if motion is None else positions(motion.states))


def _beside(plan: PlanRecord, moving: bool) -> tuple[Motion, ...]:
    """What is drawn faintly: earlier iterations while the plan moves, then where other first guesses have led."""
    return plan.shown_trail if moving else plan.others

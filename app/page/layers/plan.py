"""Plan: its trajectory, a few earlier iterations, and the body along it."""

from collections.abc import Hashable
from enum import Enum

import numpy as np
import viser

from nerfnav.planner import FLYABLE, PLANNERS, PlanOutcome
from nerfnav.robots import Motion, Robot
from nerfnav_app.jobs.events import PlannerResult
from nerfnav_app.page.kit.theme import CLEARANCE_CM, HIT, PLAN, STALE, on_scale
from nerfnav_app.page.layers.nodes import Bodies, Fan, Line, Trail, Tube, drops, positions, segments
from nerfnav_app.page.layers.shapes import tube
from nerfnav_app.queries.clearance import Clearance, ClearanceQuery
from nerfnav_app.state.plan import NO_TRAJECTORY, PlanRecord
from nerfnav_app.state.session import Session
from nerfnav_app.state.view import CameraMode, ViewSettings

_THICKNESS = 0.017  # [m]
_COMPARED = 0.008  # thickness of the lines of compared planners [m]
_STRONG, _FAINT = 2.5, 0.4  # of the highlighted one, and of the others meanwhile


class PlanLayer:
    """Layer of a plan and its iterations as they are computed."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._line = Line(server, "/plan/line", PLAN, _THICKNESS, through=True)
        self._clearances = Fan(server, "/plan/room", None, 1.2 * _THICKNESS)
        self._drops = Fan(server, "/plan/drops", STALE, 0.2 * _THICKNESS)
        self._trail = Trail(server, "/plan/trail", PLAN, 0.5 * _THICKNESS)
        self._bodies = Bodies(server, "/plan/bodies", PLAN, opacity=0.35)
        self._margin = Tube(server, "/plan/margin", PLAN, opacity=0.12)
        self._comparison = {
            name: Line(server, f"/plan/{name}", entry.color, _COMPARED) for name, entry in PLANNERS.items()
        }
        self._compared: tuple[tuple[PlannerResult, ...], str | None] = (), None
        self._floor = 0.0
        self._plan: PlanRecord | None = None
        self._clearance: Clearance | None = None
        self._shown: Hashable = None

    def show(self, session: Session) -> None:
        """Draw the plan as `choose_plan_style` says."""
        self._compare(session.comparison, session.highlighted)
        plan, style, view = session.plan, choose_plan_style(session), session.view_settings
        busy = session.job is not None or session.held
        clearance = None if session.flight_is_shown else ClearanceQuery.result_shown(session)
        shown = style, busy, view
        if plan is self._plan and shown == self._shown and clearance is self._clearance:
            return
        self._plan, self._shown, self._clearance = plan, shown, clearance
        if session.place is not None:
            self._floor = float(session.place.field.box.lower[2])
        with self._server.atomic():
            self._bodies.embody(session)
            self._draw(plan if style is not PlanStyle.HIDDEN else None, style, busy, view)
            if session.place is not None:
                self._show_margin(session.place.robot, style, busy, view)

    def _draw(self, plan: PlanRecord | None, style: "PlanStyle", busy: bool, view: ViewSettings) -> None:
        """Draw the plan; the bodies along it once it no longer changes."""
        motion = None if plan is None or plan.shown is None else plan.shown.motion
        moving = busy or (plan is not None and plan.replayed is not None)
        self._line.show(
            None if motion is None else positions(motion.states), _COLORS.get(style), dashed=style is PlanStyle.UNSAFE
        )
        colored = view.clearance and not moving and style is PlanStyle.WANTED
        self._show_clearance(motion if colored else None)
        self._drops.show(None if motion is None else drops(positions(motion.states)[::2], self._floor))
        self._trail.show(_beside(plan, moving) if plan is not None and style is PlanStyle.WANTED else ())
        # the camera of the robot's own view is within the first of them
        if motion is None or moving or style is PlanStyle.STALE or view.camera is CameraMode.ROBOT:
            self._bodies.show_states(None)
        else:
            self._bodies.paint(_COLORS[style])
            self._bodies.show_states(motion.states)

    def _show_clearance(self, motion: Motion | None) -> None:
        """Colour the line by its clearance, where that is selected and known."""
        if motion is None or self._clearance is None:
            self._clearances.show(None)
        else:
            self._clearances.show(segments(positions(motion.states)), color_by_clearance(self._clearance.rows))

    def _show_margin(self, robot: Robot, style: "PlanStyle", busy: bool, view: ViewSettings) -> None:
        """Draw the room that noise asks for around a plan that rests."""
        plan, known = self._plan, self._clearance
        deviations = None if known is None else known.deviations
        moving = busy or plan is None or plan.latest is None or plan.replayed is not None
        hidden = style is not PlanStyle.WANTED or not view.margin or view.camera is CameraMode.ROBOT
        if moving or hidden or plan is None or plan.latest is None or deviations is None:
            self._margin.show(None)
        else:
            centers = positions(plan.latest.motion.states)
            self._margin.show(tube(centers, robot.body.radius, deviations))

    def _compare(self, comparison: tuple[PlannerResult, ...], highlighted: str | None) -> None:
        """Draw the plans of a comparison of planners, the highlighted one stronger, the others fainter."""
        if comparison is self._compared[0] and highlighted == self._compared[1]:
            return
        self._compared = comparison, highlighted
        results = {result.planner: result for result in comparison}
        for name, line in self._comparison.items():
            motion, outcome = _found(results.get(name))
            points = None if motion is None or outcome in NO_TRAJECTORY else positions(motion.states)
            line.thicken(_COMPARED * (1 if highlighted is None else _STRONG if name == highlighted else _FAINT))
            line.show(points, dashed=outcome is not None and outcome not in FLYABLE)


class PlanStyle(Enum):
    """Style of a plan's line."""

    HIDDEN = "not drawn: there is no trajectory, a flight shows its own, or it is switched off"
    WANTED = "in the plan's colour: up to date, or a moment behind the hand"
    STALE = "grey: ends, settings or the field have changed since"
    UNSAFE = "red dashes: not to be flown"


_COLORS = {PlanStyle.WANTED: PLAN, PlanStyle.STALE: STALE, PlanStyle.UNSAFE: HIT}


def color_by_clearance(rows: np.ndarray) -> np.ndarray:
    """Compute colours (n, 3) of the n steps of a plan from the rows of its `ClearanceQuery`."""
    low, high = CLEARANCE_CM
    return on_scale((rows[1] - low) / (high - low))


def choose_plan_style(session: Session) -> PlanStyle:
    """Choose the style of the session's plan."""
    plan = session.plan
    if plan is None or session.flight_is_shown or not plan.leads or not session.view_settings.plan:
        return PlanStyle.HIDDEN
    if session.plan_is_stale and not session.plan_follows_hand:
        return PlanStyle.STALE
    return PlanStyle.UNSAFE if plan.is_unsafe else PlanStyle.WANTED


def _found(result: PlannerResult | None) -> tuple[Motion | None, PlanOutcome | None]:
    """Read trajectory and outcome of a planner in a comparison."""
    if result is None or result.motion is None:
        return None, None
    name = result.summary.get("outcome")
    return result.motion, None if name is None else PlanOutcome[name.upper()]


def _beside(plan: PlanRecord, moving: bool) -> tuple[Motion, ...]:
    """Select faint lines: earlier iterations while the plan changes, then the results of other initial guesses."""
    return plan.shown_trail if moving else plan.others

"""Flight: its first plan, its executed path, its estimate with the 95 % regions, and what the robot intends now."""

import numpy as np
import viser

from nerfnav.estimator import Belief
from nerfnav.navigation import NavigationStep
from nerfnav.robots import RigidState
from nerfnav_app.page.kit.theme import BELIEF, GUST, HIT, PLAN, TRUTH
from nerfnav_app.page.layers.nodes import Bodies, Fan, Line, Trail, positions
from nerfnav_app.page.layers.shapes import ball, cone, ellipsoids
from nerfnav_app.state.flight import FlightRecord
from nerfnav_app.state.session import Session
from nerfnav_app.state.view import CameraMode, ViewSettings
from nerfnav_app.text import number

_ARROW = 0.2  # length of what stands for a gust [m]
_LARGEST, _FAINT = 0.1, 0.12  # half axis that is drawn as it is, in diagonals of the place; opacity of what is larger
_PAST = 5  # earlier plans that are still drawn


class FlightLayer:
    """Layer of first plan, executed path and estimate, each of which can be switched off, and the current plan."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._truth = Line(server, "/flight/truth", TRUTH, 0.016, through=True)
        self._belief = Line(server, "/flight/belief", BELIEF, 0.004)
        self._first_plan = Line(server, "/flight/first_plan", PLAN, 0.009)
        self._plan = Line(server, "/flight/plan", PLAN, 0.013, through=True)
        self._past = Trail(server, "/flight/plans", PLAN, 0.006)
        unit = ball()
        self._covariance = Bodies(server, "/flight/covariance", BELIEF, 0.3, unit)
        self._lost = Bodies(server, "/flight/lost", BELIEF, _FAINT, unit)
        self._size_label = server.scene.add_label("/flight/lost/label", "", visible=False, anchor="bottom-center")
        self._means = Bodies(server, "/flight/means", BELIEF, None, unit)
        self._nose = Fan(server, "/flight/attitude", BELIEF, 0.004)
        self._hits = Bodies(server, "/flight/hits", HIT, 0.9, unit)
        self._gusts = Fan(server, "/flight/gusts", GUST, 0.008)
        self._robot = Bodies(server, "/flight/robot", TRUTH, opacity=None)
        self._ghost = Bodies(server, "/flight/ghost", BELIEF, opacity=0.5)
        self._shown: tuple[FlightRecord | None, ViewSettings] | None = None

    def show(self, session: Session) -> None:
        """Draw the flight as far as it has gone."""
        flight, view = session.shown_flight, session.view_settings.of_flights()
        if session.compares_planners:  # whose lines are the only ones meanwhile
            flight = None
        if self._shown is not None and self._shown[0] is flight and self._shown[1] == view:
            return
        self._shown = flight, view
        size = float(session.place.field.box.size.norm()) if session.place is not None else np.inf
        with self._server.atomic():
            self._robot.embody(session)
            self._ghost.embody(session)
            steps = () if flight is None else flight.steps
            marked = view.camera is not CameraMode.ROBOT  # the camera of the robot's own view is within its marks
            self._robot.show_states(RigidState.stack([steps[-1].truth]) if steps and marked else None)
            self._show_plans(flight if view.plan else None)
            self._show_executed(flight if view.executed else None)
            self._show_estimate(flight if view.estimate else None, view, size)

    def _show_plans(self, flight: FlightRecord | None) -> None:
        """Draw the first plan in dashes, and under way what the robot intends now and did before."""
        steps = () if flight is None else flight.steps
        first = steps[0].first_plan if steps else None
        self._first_plan.show(None if first is None else positions(first.states), dashed=True)
        under_way = flight is not None and bool(steps) and flight.outcome is None
        intent = flight.plan if flight is not None and under_way else None
        self._plan.show(None if intent is None else positions(intent.states))
        self._past.show(tuple(step.plan for step in steps[-1 - _PAST : -1]) if under_way else ())

    def _show_executed(self, flight: FlightRecord | None) -> None:
        """Draw the true path with its collisions and gusts."""
        steps = () if flight is None else flight.steps
        true = _centers([step.truth for step in steps])
        self._truth.show(true)
        self._gusts.show(arrows(steps, () if flight is None else flight.gusts))
        self._hits.show(*_balls(true[[step.touched for step in steps]], radius=0.025))

    def _show_estimate(self, flight: FlightRecord | None, view: ViewSettings, size: float) -> None:
        """Draw the estimated path with its covariances, and the robot where it believes to be.

        In the robot's own view, which is within these marks, the path alone.
        """
        self._belief.show(_centers([step.belief.mean for step in (() if flight is None else flight.steps)]))
        flight, scale = None if view.camera is CameraMode.ROBOT else flight, view.ellipsoid
        steps = () if flight is None else flight.steps
        believed = _centers([step.belief.mean for step in steps])
        self._show_covariances([step.belief for step in steps], scale, size)
        self._nose.show(cone(steps[-1].belief, scale) if steps else None)
        # dots: the line of a good estimate lies within the line of the truth
        self._means.show(*_balls(believed, radius=0.014))
        guess = (flight.guess if flight is not None else None) or (steps[-1].belief.mean if steps else None)
        self._ghost.show_states(None if guess is None else RigidState.stack([guess]))

    def _show_covariances(self, beliefs: list[Belief], scale: float, size: float) -> None:
        """Draw the 95 % regions, `scale` times as large as they are.

        Of those that would be longer than a fifth of the diagonal `size` [m] of the place, the last alone is drawn, as
        long as that, with a label.
        """
        centers, wxyzs, half = ellipsoids(beliefs)
        sure = scale * half.max(-1, initial=0) <= _LARGEST * size
        self._covariance.show(centers[sure], wxyzs[sure], scale * half[sure])
        lost = slice(-1, None) if beliefs and not sure[-1] else slice(0, 0)
        self._lost.show(centers[lost], wxyzs[lost], np.minimum(scale * half[lost], _LARGEST * size))
        self._size_label.visible = bool(beliefs) and not sure[-1]
        if self._size_label.visible:
            self._size_label.text = f"position ± {number(half[-1].max(), 'm', digits=2)}, drawn smaller"
            self._size_label.position = tuple(centers[-1].tolist())


def arrows(steps: tuple[NavigationStep, ...], gusts: tuple[int, ...]) -> np.ndarray | None:
    """Build segments (3 n, 2, 3) [m] of an arrow for each gust, from the planned to the true position."""
    made = []
    for index in gusts:
        if not 0 < index < len(steps) or len(steps[index - 1].plan.states.position) < 2:
            continue
        to = steps[index].truth.position.detach().double().numpy()
        along = to - steps[index - 1].plan.states.position[1].detach().double().numpy()
        along /= max(float(np.linalg.norm(along)), 1e-9)
        across = np.cross(along, [0.0, 0.0, 1.0])
        tail = to - _ARROW * along
        barbs = [to - 0.3 * _ARROW * (along + side * across) for side in (-1, 1)]
        made += [(tail, to), (barbs[0], to), (barbs[1], to)]
    return np.array(made) if made else None


def _centers(states: list[RigidState]) -> np.ndarray:
    """Stack the positions of separate states (n, 3) [m]."""
    return np.array([state.position.detach().numpy() for state in states], np.float32).reshape(-1, 3)


def _balls(at: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return at, np.tile([1.0, 0, 0, 0], (len(at), 1)), np.full_like(at, radius)

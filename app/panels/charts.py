"""Charts over the time of a flight."""

import numpy as np
import viser

from app.panels.chart import Chart
from app.records import FlightRecord
from app.session import Session
from app.theme import BELIEF, HIT, PLAN, TRUTH
from nerfnav.navigation.steps import NavigationStep
from nerfnav.robots.state import POSITION

_SIGMAS = 3.0
_ERRORS = ((TRUTH, "position error [cm]"), (BELIEF, "three standard deviations [cm]"))
_TIMES = ((BELIEF, "filter [ms]"), (PLAN, "replanning [ms]"), (HIT, "time of a step [ms]"))


class ErrorsChart:
    """How wrong the estimate is, and how wrong it says it may be."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._chart = Chart(server, "time [s]", _ERRORS)
        self._shown: FlightRecord | None = None

    def show(self, session: Session) -> None:
        """Draw the flight as far as it has gone."""
        if session.shown_flight is not self._shown:
            self._shown = session.shown_flight
            self._chart.show(error_curves(_steps(session)))


class TimesChart:
    """What each time step took, and what it may take."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._chart = Chart(server, "time [s]", _TIMES)
        self._shown: FlightRecord | None = None

    def show(self, session: Session) -> None:
        """Draw the flight as far as it has gone."""
        if session.shown_flight is not self._shown:
            self._shown = session.shown_flight
            self._chart.show(time_curves(_steps(session)))


def _steps(session: Session) -> tuple[NavigationStep, ...]:
    return () if session.shown_flight is None else session.shown_flight.steps


def error_curves(steps: tuple[NavigationStep, ...]) -> np.ndarray:
    """Rows: time [s], position error [cm], three standard deviations of the believed position [cm]."""
    rows = [
        (
            step.time,
            100 * (step.truth.position - step.belief.mean.position).norm().item(),
            100 * _SIGMAS * step.belief.covariance.diagonal()[POSITION].sum().clamp_min(0).sqrt().item(),
        )
        for step in steps
    ]
    return np.array(rows, dtype=np.float64).reshape(-1, 3).T


def time_curves(steps: tuple[NavigationStep, ...]) -> np.ndarray:
    """Rows: time [s], the filter's and the planner's time [ms], the time that a step may take [ms]."""
    rows = [(step.time, step.filter_ms, step.replan_ms, 1e3 * step.plan.dt) for step in steps]
    return np.array(rows, dtype=np.float64).reshape(-1, 4).T

"""Flight charts: position error with three standard deviations, and computing times, over the time of a flight."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import viser

from nerfnav.navigation import NavigationStep
from nerfnav.robots import POSITION
from nerfnav_app.page.kit.chart import Chart
from nerfnav_app.page.kit.theme import BELIEF, HIT, PLAN, TRUTH, Rgb
from nerfnav_app.state.records import FlightRecord
from nerfnav_app.state.session import Session

_SIGMAS = 3.0


@dataclass(frozen=True)
class Curves:
    """What a chart tells of a flight."""

    lines: tuple[tuple[Rgb, str], ...]
    """Colour and name with unit of each line."""
    of: Callable[[tuple[NavigationStep, ...]], np.ndarray]
    """The flight's steps to rows: time [s], then each line."""


class FlightRows:
    """Curves of a flight that grows: only its new steps are asked for."""

    def __init__(self, of: Callable[[tuple[NavigationStep, ...]], np.ndarray]) -> None:
        """`of` makes rows of steps, each column of one of them."""
        self._of, self._rows = of, of(())
        self._steps: tuple[NavigationStep, ...] = ()

    def of(self, steps: tuple[NavigationStep, ...]) -> np.ndarray:
        """The rows of all steps."""
        known = len(self._steps)
        if known and (len(steps) < known or steps[0] is not self._steps[0] or steps[known - 1] is not self._steps[-1]):
            self._rows, known = self._of(()), 0
        if len(steps) > known:
            self._rows = np.concatenate([self._rows, self._of(steps[known:])], axis=1)
        self._steps = steps
        return self._rows


class FlightChart:
    """Curves of the whole flight, with a cursor at the time that is shown."""

    def __init__(self, server: viser.ViserServer, curves: Curves) -> None:
        self._chart = Chart(server, "time [s]", curves.lines)
        self._rows = FlightRows(curves.of)
        self._shown: tuple[FlightRecord | None, float | None] = None, None

    def show(self, session: Session) -> None:
        """Draw the flight, where it is not drawn already."""
        shown = session.flight, time_shown(session)
        if shown[0] is not self._shown[0] or shown[1] != self._shown[1]:
            self._chart.show(self._rows.of(() if session.flight is None else session.flight.steps), shown[1])
        self._shown = shown


def time_shown(session: Session) -> float | None:
    """The time of the flight that the page shows [s]; None without a flight."""
    flight = session.shown_flight
    return flight.steps[-1].time if flight is not None and flight.steps else None


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


ERRORS = Curves(((TRUTH, "position error [cm]"), (BELIEF, "three standard deviations [cm]")), error_curves)
"""How wrong the estimate is, and how wrong it says it may be."""
TIMES = Curves(((BELIEF, "filter [ms]"), (PLAN, "replanning [ms]"), (HIT, "time of a step [ms]")), time_curves)
"""What each time step took, and what it may take."""

"""Charts of a flight: how wrong the estimate is and how wrong it says it may be, and what each time step took."""

import numpy as np
import viser
from viser import uplot

from app.records import FlightRecord
from app.session import Session
from app.theme import BELIEF, HIT, PLAN, STALE, TRUTH, Rgb, css
from app.widgets import legend
from nerfnav.navigation.steps import NavigationStep
from nerfnav.robots.state import POSITION

_SIGMAS = 3.0
_ERRORS = ((TRUTH, "position error [cm]"), (BELIEF, "three standard deviations [cm]"))
_TIMES = ((BELIEF, "filter [ms]"), (PLAN, "replanning [ms]"), (HIT, "time of a step [ms]"))


class ChartsPanel:
    """Two charts over the time of the flight [s]."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._errors = _Chart(server, _ERRORS)
        self._times = _Chart(server, _TIMES)
        self._shown: FlightRecord | None = None

    def show(self, session: Session) -> None:
        """Draw the flight as far as it has gone."""
        flight = session.shown_flight
        if flight is self._shown:
            return
        self._shown = flight
        steps = flight.steps if flight is not None else ()
        self._errors.show(error_curves(steps))
        self._times.show(time_curves(steps))


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


class _Chart:
    """Lines over time with a legend, hidden while there are fewer than two points."""

    def __init__(self, server: viser.ViserServer, lines: tuple[tuple[Rgb, str], ...]) -> None:
        start = np.array([0.0, 1.0])
        quiet = uplot.Axis_Ticks(show=False)
        grid = uplot.Axis_Grid(stroke=css(STALE), width=0.3)
        series = [uplot.Series(label="time [s]")]
        series += [uplot.Series(label=name, stroke=css(color), width=1.75) for color, name in lines]
        self._chart = server.gui.add_uplot(
            (start, *(start for _ in lines)),
            tuple(series),
            scales={"x": uplot.Scale(time=False)},
            axes=(uplot.Axis(size=26, ticks=quiet, grid=grid), uplot.Axis(size=44, ticks=quiet, grid=grid)),
            legend=uplot.Legend(show=False),
            padding=(10, 12, 0, 0),
            height=130,
            visible=False,
        )
        self._legend = server.gui.add_html(legend(lines), visible=False)

    def show(self, rows: np.ndarray) -> None:
        """Draw rows: time, then one for each line."""
        enough = rows.shape[1] > 1
        if enough:
            self._chart.data = tuple(rows)
        self._chart.visible = self._legend.visible = enough

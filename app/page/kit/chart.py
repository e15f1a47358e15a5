"""Charts: lines over one axis with a legend, and the curves of a flight with a cursor at the time that is shown.

The curves are position error with three standard deviations, and computing times.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import viser
from viser import uplot

from nerfnav.navigation import NavigationStep
from nerfnav.robots import POSITION
from nerfnav_app.page.kit.html import LegendEntry, legend, note
from nerfnav_app.page.kit.theme import BELIEF, HIT, PLAN, STALE, TRUTH, css
from nerfnav_app.state.flight import FlightRecord
from nerfnav_app.state.session import Session

_CURSOR = "#9aa0ae"
_SIGMAS = 3.0


class Chart:
    """A uPlot chart with a legend, hidden while there are fewer than two points."""

    def __init__(
        self,
        server: viser.ViserServer,
        across: str,
        lines: tuple[LegendEntry, ...],
        logarithmic: bool = False,
        least_top: float | None = None,
    ) -> None:
        """Add it to the panel; `across` and `lines` name the axes with units, `lines` with colours.

        With `least_top` the vertical axis begins at 0 and reaches at least that: the page writes ticks with three
        decimals, so that those of smaller numbers are all "0".
        """
        start = np.array([0.0, 1.0])
        quiet, grid = uplot.Axis_Ticks(show=False), uplot.Axis_Grid(stroke=css(STALE), width=0.3)
        scales = {"x": uplot.Scale(time=False)} | ({"y": uplot.Scale(distr=3)} if logarithmic else {})
        if least_top is not None:
            scales["y"] = uplot.Scale(range=_from_zero(least_top))
        self._chart = server.gui.add_uplot(
            (start, *(start + 1e-3 for _ in lines), start + 1e-3),
            (
                uplot.Series(label=across),
                *(uplot.Series(label=line.meaning, stroke=css(line.color), width=1.75) for line in lines),
                uplot.Series(label="shown", stroke=_CURSOR, width=1.0),
            ),
            scales=scales,
            axes=(uplot.Axis(size=26, ticks=quiet, grid=grid), uplot.Axis(size=44, ticks=quiet, grid=grid)),
            legend=uplot.Legend(show=False),
            padding=(10, 12, 0, 0),
            height=150 if logarithmic else 120,
            visible=False,
        )
        self._lines = lines
        self._legend = server.gui.add_html(legend(lines), visible=False)

    def show(self, rows: np.ndarray, at: float | None = None, top: float = np.inf) -> None:
        """Draw rows: the horizontal axis, then one row for each line; with a cursor at the position `at`.

        What is above `top` is clipped there, and the legend says so.
        """
        enough = rows.shape[1] > 1
        if enough:
            highest = float(rows[1:].max())
            clipped = np.concatenate([rows[:1], np.minimum(rows[1:], top)])
            self._chart.data = tuple(with_cursor(clipped, at))
            mark = note(f"Clipped at the top: values up to {highest:,.0f}") if highest > top else ""
            self._legend.content = legend(self._lines) + mark
        self._chart.visible = self._legend.visible = enough


def _from_zero(least_top: float) -> Any:
    """Build the range of an axis from 0 to the largest value, and to at least `least_top`."""
    low = {"hard": 0.0, "soft": 0.0, "mode": _ALWAYS, "pad": 0.0}
    return {"min": low, "max": {"soft": least_top, "mode": _ALWAYS, "pad": 0.1}}


_ALWAYS = 1
"""Mode of uPlot in which an axis always reaches its soft limit."""


def with_cursor(rows: np.ndarray, at: float | None) -> np.ndarray:
    """Add to rows (1 + lines, n) that of the cursor: the lowest value, with a spike to the highest one at `at`."""
    across, lines = rows[0], rows[1:]
    least, most = lines.min(), lines.max()
    if at is None or not across[0] <= at <= across[-1]:
        return np.concatenate([rows, np.full((1, len(across)), least)])
    index = np.searchsorted(across, at)
    here = np.array([at, *(np.interp(at, across, line) for line in lines)])[:, None]
    rows = np.insert(rows, [index] * 3, np.repeat(here, 3, axis=1), axis=1)
    cursor = np.full(rows.shape[1], least)
    cursor[index + 1] = most
    return np.concatenate([rows, cursor[None]])


@dataclass(frozen=True)
class Curves:
    """Curves of a chart: their legend, and the function that computes them from a flight."""

    lines: tuple[LegendEntry, ...]
    """Colour and name with unit of each line."""
    of: Callable[[tuple[NavigationStep, ...]], np.ndarray]
    """Computes rows from the steps of a flight: time [s], then each line."""
    top: Callable[[np.ndarray], float] = lambda rows: np.inf
    """Computes from the rows the value above which they are clipped."""


class FlightRows:
    """Rows of a growing flight: only its new steps are computed."""

    def __init__(self, of: Callable[[tuple[NavigationStep, ...]], np.ndarray]) -> None:
        """`of` computes rows from steps, a column for each step."""
        self._of, self._rows = of, of(())
        self._steps: tuple[NavigationStep, ...] = ()

    def of(self, steps: tuple[NavigationStep, ...]) -> np.ndarray:
        """Compute the rows of all steps."""
        known = len(self._steps)
        if known and (len(steps) < known or steps[0] is not self._steps[0] or steps[known - 1] is not self._steps[-1]):
            self._rows, known = self._of(()), 0
        if len(steps) > known:
            self._rows = np.concatenate([self._rows, self._of(steps[known:])], axis=1)
        self._steps = steps
        return self._rows


class FlightChart:
    """Chart of the whole flight, with a cursor at the time that is shown."""

    def __init__(self, server: viser.ViserServer, curves: Curves) -> None:
        self._chart = Chart(server, "time [s]", curves.lines)
        self._rows, self._top = FlightRows(curves.of), curves.top
        self._shown: tuple[FlightRecord | None, float | None] = None, None

    def show(self, session: Session) -> None:
        """Draw the flight, unless it is drawn already."""
        shown = session.flight, time_shown(session)
        if shown[0] is not self._shown[0] or shown[1] != self._shown[1]:
            rows = self._rows.of(() if session.flight is None else session.flight.steps)
            self._chart.show(rows, shown[1], self._top(rows))
        self._shown = shown


def time_shown(session: Session) -> float | None:
    """Read the time of the flight that the page shows [s]; None without a flight."""
    flight = session.shown_flight
    return flight.steps[-1].time if flight is not None and flight.steps else None


def error_curves(steps: tuple[NavigationStep, ...]) -> np.ndarray:
    """Compute rows: time [s], position error [cm], three standard deviations of the estimated position [cm]."""
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
    """Compute rows: time [s], computing times of filter and planner [ms], length of a time step [ms]."""
    rows = [(step.time, step.filter_ms, step.replan_ms, 1e3 * step.plan.dt) for step in steps]
    return np.array(rows, dtype=np.float64).reshape(-1, 4).T


def top_of_times(rows: np.ndarray) -> float:
    """Compute the top of the chart of times [ms]: above most of the steps after the first, which may have compiled."""
    later = rows[1:, 1:]
    return _ROOM * float(np.percentile(later.max(0), _MOST)) if later.size else np.inf


_MOST, _ROOM = 95, 1.3
"""Percentile of the later steps that is seen whole, and the room above it."""


ERRORS = Curves(
    (LegendEntry(TRUTH, "position error [cm]"), LegendEntry(BELIEF, "three standard deviations [cm]")), error_curves
)
"""True position error, and the error that the covariance predicts."""
TIMES = Curves(
    (LegendEntry(BELIEF, "filter [ms]"), LegendEntry(PLAN, "replanning [ms]"), LegendEntry(HIT, "time step [ms]")),
    time_curves,
    top_of_times,
)
"""Computing times of each time step, and its length."""

"""A chart: lines over one axis, with a legend."""

import numpy as np
import viser
from viser import uplot

from app.page.html import legend
from app.page.theme import STALE, Rgb, css


class Chart:
    """Hidden while there are fewer than two points."""

    def __init__(
        self, server: viser.ViserServer, across: str, lines: tuple[tuple[Rgb, str], ...], logarithmic: bool = False
    ) -> None:
        """`across` and `lines` are names with units, `lines` with their colours."""
        start = np.array([0.0, 1.0])
        quiet, grid = uplot.Axis_Ticks(show=False), uplot.Axis_Grid(stroke=css(STALE), width=0.3)
        series = [uplot.Series(label=across)]
        series += [uplot.Series(label=name, stroke=css(color), width=1.75) for color, name in lines]
        scales = {"x": uplot.Scale(time=False)} | ({"y": uplot.Scale(distr=3)} if logarithmic else {})
        self._chart = server.gui.add_uplot(
            (start, *(start + 1e-3 for _ in lines)),
            tuple(series),
            scales=scales,
            axes=(uplot.Axis(size=26, ticks=quiet, grid=grid), uplot.Axis(size=44, ticks=quiet, grid=grid)),
            legend=uplot.Legend(show=False),
            padding=(10, 12, 0, 0),
            height=150 if logarithmic else 120,
            visible=False,
        )
        self._legend = server.gui.add_html(legend(lines), visible=False)

    def show(self, rows: np.ndarray) -> None:
        """Draw rows: positions across, then one row for each line."""
        enough = rows.shape[1] > 1
        if enough:
            self._chart.data = tuple(rows)
        self._chart.visible = self._legend.visible = enough

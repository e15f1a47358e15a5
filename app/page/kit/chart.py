"""Chart: lines over one axis, with a legend."""

import numpy as np
import viser
from viser import uplot

from nerfnav_app.page.kit.html import legend
from nerfnav_app.page.kit.theme import STALE, Rgb, css

_CURSOR = "#9aa0ae"


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
        series.append(uplot.Series(label="shown", stroke=_CURSOR, width=1.0))
        scales = {"x": uplot.Scale(time=False)} | ({"y": uplot.Scale(distr=3)} if logarithmic else {})
        self._chart = server.gui.add_uplot(
            (start, *(start + 1e-3 for _ in lines), start + 1e-3),
            tuple(series),
            scales=scales,
            axes=(uplot.Axis(size=26, ticks=quiet, grid=grid), uplot.Axis(size=44, ticks=quiet, grid=grid)),
            legend=uplot.Legend(show=False),
            padding=(10, 12, 0, 0),
            height=150 if logarithmic else 120,
            visible=False,
        )
        self._legend = server.gui.add_html(legend(lines), visible=False)

    def show(self, rows: np.ndarray, at: float | None = None) -> None:
        """Draw rows: positions across, then one row for each line; with a cursor at the position `at`."""
        enough = rows.shape[1] > 1
        if enough:
            self._chart.data = tuple(with_cursor(rows, at))
        self._chart.visible = self._legend.visible = enough


def with_cursor(rows: np.ndarray, at: float | None) -> np.ndarray:
    """Rows (1 + lines, n) with one more: along the lowest value, up to the highest one and back where the cursor is."""
    across, lines = rows[0], rows[1:]
    least, most = lines.min(), lines.max()
    if at is None or not across[0] <= at <= across[-1]:
        return np.concatenate([rows, np.full((1, len(across)), least)])
    where = np.searchsorted(across, at)
    here = np.array([at, *(np.interp(at, across, line) for line in lines)])[:, None]
    rows = np.insert(rows, [where] * 3, np.repeat(here, 3, axis=1), axis=1)
    cursor = np.full(rows.shape[1], least)
    cursor[where + 1] = most
    return np.concatenate([rows, cursor[None]])

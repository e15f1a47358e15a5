"""Charts: what is clipped, and how far their axes reach."""

from typing import Any

import numpy as np
import pytest
import viser

from nerfnav_app.page.kit.chart import TIMES, Chart, top_of_times
from nerfnav_app.page.kit.html import LegendEntry
from nerfnav_app.page.kit.theme import HIT


def times(filter_ms: list[float]) -> np.ndarray:
    """Rows of the chart of times, with 20 ms for the planner and 100 ms a step."""
    count = len(filter_ms)
    return np.stack([0.1 * np.arange(count), filter_ms, np.full(count, 20.0), np.full(count, 100.0)])


def test_a_first_step_that_compiles_does_not_scale_the_chart_of_times_and_is_marked(server: viser.ViserServer) -> None:
    rows = times([10_000.0, *19 * [30.0]])
    assert top_of_times(rows) == pytest.approx(130)
    chart = Chart(server, "time [s]", TIMES.lines)
    chart.show(rows, top=TIMES.top(rows))
    assert chart._chart.data[1].max() == pytest.approx(130) and "10,000" in chart._legend.content
    warm = times(20 * [30.0])
    chart.show(warm, top=TIMES.top(warm))
    assert chart._chart.data[3].max() == 100 and "Clipped" not in chart._legend.content, "it is not for good"


def test_a_chart_of_times_without_a_later_step_is_not_clipped() -> None:
    assert top_of_times(times([])) == top_of_times(times([10_000.0])) == np.inf


def test_an_axis_of_small_numbers_reaches_far_enough_for_ticks_of_three_decimals(server: viser.ViserServer) -> None:
    chart = Chart(server, "time [s]", (LegendEntry(HIT, "risk [%]"),), least_top=0.01)
    assert chart._chart.scales is not None
    reach: Any = chart._chart.scales["y"]["range"]  # type: ignore[typeddict-item]
    assert reach["min"]["hard"] == 0 and reach["max"] == {"soft": 0.01, "mode": 1, "pad": 0.1}

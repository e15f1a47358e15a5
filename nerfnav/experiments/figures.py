"""Figures of results, drawn without a screen."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from nerfnav.core.extras import import_extra

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
else:
    Axes = Figure = Any  # matplotlib is an extra, and slow to import

COLORS = ("#2a7f9e", "#d98c3f", "#8a5a9e", "#5c8a4a", "#b0494d")
"""One for each contender, in their order."""


def panels(titles: Sequence[str], height: float = 3.4) -> tuple[Figure, list[Axes]]:
    """Make a figure with one set of axes for each title, side by side. Raises MissingExtraError without matplotlib."""
    drawing = import_extra("matplotlib.figure", "experiments", "drawing a figure")
    figure = drawing.Figure(figsize=(3.8 * len(titles), height), dpi=150, layout="constrained")
    row = figure.subplots(1, len(titles), squeeze=False)[0]
    for axes, title in zip(row, titles, strict=True):
        axes.set_title(title, fontsize=10)
        axes.spines[["top", "right"]].set_visible(False)
    return figure, list(row)


def bars(
    axes: Axes,
    values: Mapping[str, float],
    unit: str,
    samples: Mapping[str, Sequence[float]] | None = None,
) -> None:
    """Draw one labelled bar for each name; with `samples`, the single values as dots on it."""
    for index, (name, value) in enumerate(values.items()):
        color = COLORS[index % len(COLORS)]
        axes.bar(index, value, width=0.62, color=color, alpha=0.85)
        axes.annotate(
            f"{value:.3g}", (index, value), xytext=(0, 3), textcoords="offset points", ha="center", fontsize=9
        )
        if samples is not None:
            many = samples[name]
            offsets = [index + 0.4 * (k / max(1, len(many) - 1) - 0.5) for k in range(len(many))]
            axes.plot(offsets, many, ".", color="black", markersize=3, alpha=0.5)
    axes.set_xticks(range(len(values)), list(values))
    axes.set_ylabel(unit)


def draw_distribution(axes: Axes, values: Sequence[float], color: str, label: str) -> None:
    """Draw the distribution function of some values; nothing where there are none."""
    if values:
        axes.step(np.sort(values), np.arange(1, len(values) + 1) / len(values), where="post", color=color, label=label)

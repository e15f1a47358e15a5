"""Figures of results, drawn without a screen."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from nerfnav.core.extras import import_extra

if TYPE_CHECKING:
    import matplotlib.axes
    import matplotlib.figure

COLORS = ("#2a7f9e", "#d98c3f", "#8a5a9e", "#5c8a4a", "#b0494d")
"""One for each contender, in their order."""


def panels(
    titles: Sequence[str], height: float = 3.4
) -> tuple["matplotlib.figure.Figure", list["matplotlib.axes.Axes"]]:
    """A figure with one set of axes for each title, side by side. Raises MissingExtraError without matplotlib."""
    drawing = import_extra("matplotlib.figure", "experiments", "drawing a figure")
    figure = drawing.Figure(figsize=(3.8 * len(titles), height), dpi=150, layout="constrained")
    row = figure.subplots(1, len(titles), squeeze=False)[0]
    for axes, title in zip(row, titles, strict=True):
        axes.set_title(title, fontsize=10)
        axes.spines[["top", "right"]].set_visible(False)
    return figure, list(row)


def bars(
    axes: "matplotlib.axes.Axes",
    values: Mapping[str, float],
    unit: str,
    spread: Mapping[str, Sequence[float]] | None = None,
) -> None:
    """One labelled bar for each name; with `spread`, the single values as dots on it."""
    for index, (name, value) in enumerate(values.items()):
        color = COLORS[index % len(COLORS)]
        axes.bar(index, value, width=0.62, color=color, alpha=0.85)
        axes.annotate(
            f"{value:.3g}", (index, value), xytext=(0, 3), textcoords="offset points", ha="center", fontsize=9
        )
        if spread is not None:
            many = spread[name]
            offsets = [index + 0.4 * (k / max(1, len(many) - 1) - 0.5) for k in range(len(many))]
            axes.plot(offsets, many, ".", color="black", markersize=3, alpha=0.5)
    axes.set_xticks(range(len(values)), list(values))
    axes.set_ylabel(unit)

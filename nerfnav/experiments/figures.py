"""Figures of results, drawn without a screen.

Colours are those of Okabe and Ito ("Color universal design", 2008), which the colour-blind tell apart. Each goes with a
line style and a hatch, so that prints in grey can be read.
"""

import io
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from nerfnav.core.extras import import_extra

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
else:
    Axes = Figure = Any  # matplotlib is an extra, and slow to import

COLORS = ("#0072b2", "#e69f00", "#cc79a7", "#009e73", "#d55e00")
"""One for each contender, in their order."""
_DASHES = {"#e69f00": "--", "#cc79a7": "-.", "#009e73": ":", "#d55e00": (0, (5, 1, 1, 1, 1, 1))}
_HATCHES = {"#e69f00": "//", "#cc79a7": "..", "#009e73": "xx", "#d55e00": "--"}
_DPI, _HAIRLINE = 200, 1.0
"""Pixels an inch of figures, and width [pt] under which lines stay solid."""


def panels(titles: Sequence[str], height: float = 3.4) -> tuple[Figure, list[Axes]]:
    """Make a figure with one set of axes for each title, side by side. Raises MissingExtraError without matplotlib."""
    drawing = import_extra("matplotlib.figure", "experiments", "drawing a figure")
    figure = drawing.Figure(figsize=(3.8 * len(titles), height), dpi=_DPI, layout="constrained")
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


def file_of(figure: Figure, kind: Literal["png", "svg"]) -> bytes:
    """Encode a figure for screen and print, with equal bytes for equal figures."""
    drawing, stream = import_extra("matplotlib", "experiments", "drawing a figure"), io.BytesIO()
    _distinguish_in_grey(figure)
    with drawing.rc_context({"svg.hashsalt": "nerfnav"}):
        figure.savefig(stream, format=kind, metadata={"Date": None} if kind == "svg" else None)
    return stream.getvalue()


def _distinguish_in_grey(figure: Figure) -> None:
    """Give the solid lines and the bars of each colour, but hairlines, a style and a hatch of their own."""
    for axes in figure.axes:
        legend = axes.get_legend()
        for line in [*axes.lines, *(legend.get_lines() if legend is not None else ())]:
            if line.get_linestyle() == "-" and line.get_linewidth() >= _HAIRLINE:
                line.set_linestyle(_DASHES.get(str(line.get_color()), "-"))
        for bar in axes.patches:
            bar.set_hatch(_HATCHES.get(_hex(bar.get_facecolor()), ""))
            bar.set_edgecolor("white")


def _hex(color: Any) -> str:
    return "#" + "".join(f"{round(255 * part):02x}" for part in color[:3])

"""Chart of how well a capture was learned in given times."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from nerfnav.experiments.figures import COLORS, panels
from nerfnav_app.jobs.bench_training import Row

if TYPE_CHECKING:
    import matplotlib.figure


def picture(rows: Sequence[Row], cores: int) -> "matplotlib.figure.Figure":
    """PSNR on held-out views against the time to learn, with the CPU time that the machine had for it."""
    figure, (axes,) = panels((f"Held-out views, {cores} cores",))
    minutes = [float(row["budget_s"] or 0) / 60 for row in rows]
    psnr = [float(row["psnr_db"] or 0) for row in rows]
    axes.plot(minutes, psnr, "o-", color=COLORS[0])
    for place, row in zip(zip(minutes, psnr, strict=True), rows, strict=True):
        label = f"{place[1]:.1f} dB\n{row['cpu_s']:.0f} CPU s"
        axes.annotate(label, place, xytext=(0, 6), textcoords="offset points", ha="center", fontsize=8)
    axes.margins(0.15, 0.25)
    axes.set_xscale("log")
    axes.set_xticks(minutes, [f"{each:g}" for each in minutes])
    axes.minorticks_off()
    axes.set_xlabel("minutes to learn")
    axes.set_ylabel("PSNR [dB]")
    return figure

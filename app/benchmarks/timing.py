"""The paper's timing paragraph as a table: the printed times, the paper's way on this machine, and nerfnav.

All times come from the benchmarks of `nerfnav bench`, which also says how they are taken: both ways in turn, on one
thread.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from nerfnav.core.errors import InvalidInputError
from nerfnav.experiments import Arena, ExperimentSteps, Results, Row, Study
from nerfnav.experiments.figures import Figure, bars, panels
from nerfnav.experiments.study import run_trials
from nerfnav_app.benchmarks import filter as filter_benchmark
from nerfnav_app.benchmarks import plan, replan
from nerfnav_app.benchmarks.comparison import Comparison

PAPER_MACHINE = "RTX 3090"
"""Hardware of the printed times."""


@dataclass(frozen=True)
class PrintedTime:
    """Time that the paper prints, and the benchmark of the same step."""

    seconds: float
    """[s]"""
    iterations: int | None
    """Iterations of Adam in that time; None: the step does not iterate."""
    measure: Callable[..., Comparison]
    """Benchmark: measure(arena, COUNTED=...)."""
    counted: str
    """Name of the benchmark's argument for the number of trials."""


PRINTED = {
    "plan": PrintedTime(20.0, 2500, plan.measure, "tasks"),
    "replan": PrintedTime(2.0, 250, replan.measure, "tasks"),
    "filter": PrintedTime(4.0, 300, filter_benchmark.measure, "views"),
    "hessian": PrintedTime(0.25, None, filter_benchmark.measure_covariance, "views"),
}
"""Rows of the table."""


@dataclass(frozen=True)
class TimingTrial:
    """Trial of the experiment: one row of the table."""

    name: str
    """One of PRINTED."""
    count: int | None
    """Tasks or views; None: as many as the benchmark takes."""


def run(study: Study) -> ExperimentSteps:
    """Time every step; `trials` is the number of tasks and views. Raises InvalidInputError for trials side by side,
    which slow each other down."""
    if (study.jobs or 1) > 1 or study.ray is not None:
        raise InvalidInputError("timing measures one thing at a time: drop --jobs and --ray")
    study.first(study.tasks, "tasks")
    rows = yield from run_trials(study, "timing", measure_row, [TimingTrial(name, study.trials) for name in PRINTED])
    shown = ("paper_s", "reference_ms", "nerfnav_ms", "ratio", "ratio_to_paper")
    summary = {row["name"]: {name: row[name] for name in shown} for row in rows}
    figures = {"timing": partial(draw_figure, rows)}
    return Results({"rows": summary, "paper_machine": PAPER_MACHINE}, tuple(rows), figures, ("name",))


def measure_row(arena: Arena, trial: TimingTrial) -> Row:
    """Time one step; `ratio` compares with the paper's way here, `ratio_to_paper` with the printed time."""
    printed = PRINTED[trial.name]
    found = printed.measure(arena, **({} if trial.count is None else {printed.counted: trial.count}))
    return {
        "name": trial.name,
        "paper_s": printed.seconds,
        "paper_iterations": printed.iterations,
        "reference_ms": found.paper_ms,
        "nerfnav_ms": found.fast_ms,
        "ratio": found.ratio,
        "ratio_to_paper": 1e3 * printed.seconds / found.fast_ms,
        "threads": found.threads,
    }


def draw_figure(rows: Sequence[Row]) -> Figure:
    """Plot the three times of each step, on a logarithmic scale."""
    figure, axes = panels([row["name"] for row in rows])
    for panel, row in zip(axes, rows, strict=True):
        panel.set_yscale("log")
        times = {"printed": 1e3 * row["paper_s"], "its way, here": row["reference_ms"], "nerfnav": row["nerfnav_ms"]}
        bars(panel, times, "ms")
    return figure

"""The timing table: rows of printed and measured times."""

from typing import Any

import pytest

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.steps import run_steps
from nerfnav.experiments import Arena, Study
from nerfnav_app.benchmarks import filter as filter_benchmark
from nerfnav_app.benchmarks import timing
from nerfnav_app.benchmarks.comparison import Comparison
from nerfnav_app.benchmarks.timing import PRINTED
from tests.experiments.places import TASKS, column


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """What each benchmark is asked for; none is run."""
    calls: list[dict[str, Any]] = []

    def measure(arena: Arena, **options: Any) -> Comparison:
        calls.append(options)
        return Comparison("", 100.0, 4.0, 1, {})

    for name, printed in PRINTED.items():
        changed = timing.PrintedTime(printed.seconds, printed.iterations, measure, printed.counted)
        monkeypatch.setitem(PRINTED, name, changed)
    return calls


def test_each_row_has_the_papers_time_both_times_here_and_ratios(asked: list[dict[str, Any]]) -> None:
    results = run_steps(timing.run(Study(column, TASKS, trials=2)))
    rows = results.summary["rows"]
    assert {name: row["paper_s"] for name, row in rows.items()} == {
        "plan": 20.0, "replan": 2.0, "filter": 4.0, "hessian": 0.25
    }  # fmt: skip
    assert [row["paper_iterations"] for row in results.rows] == [2500, 250, 300, None]
    assert (rows["plan"]["reference_ms"], rows["plan"]["nerfnav_ms"], rows["plan"]["ratio"]) == (100.0, 4.0, 25.0)
    assert rows["plan"]["ratio_to_paper"] == 5000.0
    assert asked == [{"tasks": 2}, {"tasks": 2}, {"views": 2}, {"views": 2}]
    assert len(results.figures["timing"]().axes) == 4


def test_without_a_number_of_trials_the_benchmarks_choose(asked: list[dict[str, Any]]) -> None:
    run_steps(timing.run(Study(column, TASKS)))
    assert asked == [{}] * 4


@pytest.mark.parametrize(("study", "why"), [
    (Study(column, TASKS, jobs=2), "--jobs"), (Study(column, TASKS, ray="local"), "--ray"),
    (Study(column, TASKS, trials=3), "2 tasks"),
])  # fmt: skip
def test_trials_side_by_side_and_more_than_there_are_tasks_are_refused(study: Study, why: str) -> None:
    with pytest.raises(InvalidInputError, match=why):
        run_steps(timing.run(study))


@pytest.mark.slow
def test_the_covariance_is_timed_by_the_exact_hessian_and_by_gauss_newton() -> None:
    found = filter_benchmark.measure_covariance(column(), views=1, fast_per_round=2)
    assert found.paper_ms > found.fast_ms > 0 and found.ratio == found.paper_ms / found.fast_ms

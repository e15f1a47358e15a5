"""Experiments and the bench from the command line's side: what is written, what is refused."""

import csv
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from matplotlib.figure import Figure

from nerfnav.core.errors import InvalidInputError, MissingExtraError, NerfnavError, UnknownNameError
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.figures import panels
from nerfnav.experiments.study import ExperimentSteps, Results, Study, TrialDone
from nerfnav_app.benchmarks.comparison import Comparison
from nerfnav_app.jobs.events import Progress
from nerfnav_app.jobs.measure import bench, experiment
from nerfnav_app.jobs.measure import bench as bench_measures
from nerfnav_app.jobs.measure import experiment as experiment_catalog
from nerfnav_app.jobs.measure.arena import open_arena
from nerfnav_app.jobs.measure.bench import BenchRequest
from nerfnav_app.jobs.measure.experiment import EXPERIMENTS, Experiment, ExperimentRequest
from nerfnav_app.storage.output_files import OutputError
from tests.app.following import result_of


def counting(study: Study) -> ExperimentSteps:
    yield TrialDone("counting", 1, 2)
    rows = tuple({"task": task.name, "share": 1 / 3, "failed": False} for task in study.tasks[: study.trials])
    return Results({"seed": study.seed, "not_a_number": float("nan")}, rows, {"empty": lambda: Figure(figsize=(1, 1))})


@pytest.fixture(autouse=True)
def known() -> Iterator[None]:
    experiment_catalog.register(Experiment("counting", counting, "counts"))
    yield
    EXPERIMENTS.unregister("counting")


def test_results_table_and_figures_are_written(tmp_path: Path) -> None:
    done = result_of(experiment.run(ExperimentRequest("counting", trials=2, seed=7, out=tmp_path / "new")))
    assert {path.name for path in done.files} == {"results.json", "counting.csv", "empty.png"}
    content = json.loads((tmp_path / "new" / "results.json").read_text())
    assert content["summary"] == {"seed": 7, "not_a_number": None}
    rows = list(csv.DictReader((tmp_path / "new" / "counting.csv").open()))
    assert [row["task"] for row in rows] == ["East to west", "South to north"]
    assert float(rows[0]["share"]) == pytest.approx(1 / 3, abs=1e-8)
    assert (tmp_path / "new" / "empty.png").read_bytes().startswith(b"\x89PNG")


def test_without_a_folder_nothing_is_written() -> None:
    assert result_of(experiment.run(ExperimentRequest("counting"))).files == ()


def test_progress_says_which_trial() -> None:
    reported = [event for event in experiment.run(ExperimentRequest("counting")) if isinstance(event, Progress)]
    assert reported[-1] == Progress("counting, 1 of 2", 0.5)


@pytest.mark.slow
def test_every_experiment_opens_where_it_says() -> None:
    for entry in EXPERIMENTS.values():
        assert open_arena(entry.place).scene.tasks


def test_an_unknown_experiment_is_refused_with_the_known_ones() -> None:
    with pytest.raises(UnknownNameError, match=", ".join(sorted({*EXPERIMENTS, "counting"}))):
        result_of(experiment.run(ExperimentRequest("guessing")))


def test_a_field_without_a_ground_truth_is_refused(field_file: Path) -> None:
    with pytest.raises(InvalidInputError, match="judged on a ground truth"):
        result_of(experiment.run(ExperimentRequest("counting", place=str(field_file))))


def test_a_folder_that_cannot_be_written_to_is_refused_before_the_work(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError):
        result_of(experiment.run(ExperimentRequest("counting", out=tmp_path / "file")))


def fake(name: str) -> Any:
    """Modules of two measures; the others do not exist."""
    if name == "scaling":
        return SimpleNamespace(measure=lambda arena, **options: options, picture=lambda scaling: Figure(figsize=(1, 1)))
    if name not in ("plan", "render"):
        return None

    def measure(arena: Arena, **options: Any) -> Comparison:
        assert arena.scene.name == "stonehenge"
        return Comparison(name, 100.0, 4.0, 2, {"options": float(len(options))})

    return SimpleNamespace(measure=measure)


def test_the_bench_tells_every_comparison_and_names_what_it_left_out(tmp_path: Path) -> None:
    done = result_of(bench.run(BenchRequest(out=tmp_path), fake))
    expected = {"paper_ms": 100.0, "fast_ms": 4.0, "ratio": 25.0, "threads": 2, "options": 0.0}
    assert done.summary["plan"] == done.summary["render"] == expected
    assert done.summary["left_out"] == ["replan", "filter", "train_step"]
    assert {path.name for path in done.files} == {"bench.json", "bench.csv", "scaling.png"}
    assert [row["name"] for row in csv.DictReader((tmp_path / "bench.csv").open())] == ["plan", "render"]


def test_a_quick_bench_asks_for_less() -> None:
    done = result_of(bench.run(BenchRequest(quick=True), fake))
    assert done.summary["quick"] is True
    assert done.summary["plan"]["options"] == len(bench_measures.QUICK["plan"])


def test_quick_options_are_those_of_the_measures() -> None:
    for name, options in bench_measures.QUICK.items():
        module = bench_measures.module_named(name)
        assert module is not None
        code = module.measure.__wrapped__ if hasattr(module.measure, "__wrapped__") else module.measure
        assert set(options) <= set(code.__code__.co_varnames), name


def test_a_bench_of_an_unknown_place_is_refused() -> None:
    with pytest.raises(NerfnavError, match="nowhere"):
        result_of(bench.run(BenchRequest("nowhere"), fake))


def test_figures_that_cannot_be_drawn_are_left_out_and_said_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def undrawn(study: Study) -> ExperimentSteps:
        yield from ()
        return Results({"left_out": {"rrt": "it is missing"}}, (), {"empty": lambda: panels(("one",))[0]})

    EXPERIMENTS.unregister("counting")
    experiment_catalog.register(Experiment("counting", undrawn, "counts"))
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)  # makes its import fail
    done = result_of(experiment.run(ExperimentRequest("counting", out=tmp_path)))
    assert [path.name for path in done.files] == ["results.json"]
    assert set(done.summary["left_out"]) == {"rrt", "figures"}
    assert "pip install 'nerfnav[experiments]'" in done.summary["left_out"]["figures"]
    with pytest.raises(MissingExtraError, match="the plot of bench --out"):
        result_of(bench.run(BenchRequest(out=tmp_path), fake))

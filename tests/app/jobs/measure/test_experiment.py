"""Experiments and the bench from the command line's side: what is written, what is refused."""

import csv
import json
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import torch
from matplotlib.figure import Figure

from nerfnav.core.errors import InvalidInputError, MissingExtraError, NerfnavError, UnknownNameError
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.figures import panels
from nerfnav.experiments.study import ExperimentSteps, Journal, Results, Study, TrialDone, TrialEnd, run_trials
from nerfnav_app.benchmarks.comparison import Comparison
from nerfnav_app.jobs.events import Progress, Remark
from nerfnav_app.jobs.measure import bench, experiment
from nerfnav_app.jobs.measure import bench as bench_measures
from nerfnav_app.jobs.measure import catalog as experiment_catalog
from nerfnav_app.jobs.measure.arena import open_arena
from nerfnav_app.jobs.measure.bench import BenchRequest
from nerfnav_app.jobs.measure.catalog import EXPERIMENTS, Experiment
from nerfnav_app.jobs.measure.experiment import ExperimentRequest
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
    assert {path.name for path in done.files} == {
        "results.json", "counting.csv", "empty.png", "empty.svg", "table.md",
    }  # fmt: skip
    assert done.files[0].name == "results.json" and {*done.files} < {*(tmp_path / "new").iterdir()}
    content = json.loads((tmp_path / "new" / "results.json").read_text())
    assert content["summary"] == {"seed": 7, "not_a_number": None}
    rows = list(csv.DictReader((tmp_path / "new" / "counting.csv").open()))
    assert [row["task"] for row in rows] == ["East to west", "South to north"]
    assert float(rows[0]["share"]) == pytest.approx(1 / 3, abs=1e-8)
    assert (tmp_path / "new" / "empty.png").read_bytes().startswith(b"\x89PNG")


def test_obstacles_of_a_file_stand_in_the_place_of_an_experiment(tmp_path: Path) -> None:
    file, above = tmp_path / "crates.yaml", torch.tensor([[0.4, 0.0, 0.3], [0.8, 0.0, 0.3]])
    file.write_text("obstacles: [{name: crate, box: [0.2, 0.2, 0.2], position: [0.4, 0, 0.3]}]")

    def measured(study: Study) -> ExperimentSteps:
        yield from ()
        arena = study.open_arena()
        inside = [bool(solid.contains(above.numpy())[0]) for solid in arena.scene.solids[-1:]]
        return Results({"dense": (arena.field.density(above) > 10).tolist(), "solid": inside}, (), {})

    experiment_catalog.register(Experiment("placed", measured, "looks at what stands there", beside=("apartment",)))
    try:
        request = ExperimentRequest("placed", obstacles=file, out=tmp_path / "out")
        assert result_of(experiment.run(request)).summary == {"dense": [True, False], "solid": [True]}
        content = json.loads((tmp_path / "out" / "manifest.json").read_text())
        assert str(file) in content["inputs"] and content["settings"]["obstacles"] == str(file)
        moving = tmp_path / "bus.yaml"
        moving.write_text("obstacles: [{name: bus, box: [1, 1, 1], motion: {velocity: [1, 0, 0]}}]")
        with pytest.raises(InvalidInputError, match="the obstacle 'bus' moves"):
            result_of(experiment.run(replace(request, out=None, obstacles=moving)))
        with pytest.raises(InvalidInputError, match="has obstacles of its own: leave out --obstacles"):
            result_of(experiment.run(ExperimentRequest("moving", obstacles=file)))
    finally:
        EXPERIMENTS.unregister("placed")


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


def test_an_experiment_in_worlds_of_its_own_takes_no_place() -> None:
    with pytest.raises(InvalidInputError, match="moving flies in worlds of its own: leave out --place"):
        result_of(experiment.run(ExperimentRequest("moving", place="church")))


@pytest.mark.parametrize("beside", [{"jobs": 2}, {"ray": "local"}])
def test_an_experiment_that_measures_times_runs_alone(beside: dict[str, Any]) -> None:
    with pytest.raises(InvalidInputError, match="moving measures times, so nothing runs beside it: leave out --jobs"):
        result_of(experiment.run(ExperimentRequest("moving", **beside)))


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
    assert [path.name for path in done.files] == ["results.json", "table.md"]
    assert set(done.summary["left_out"]) == {"rrt", "figures"}
    assert "pip install 'nerfnav[experiments]'" in done.summary["left_out"]["figures"]
    with pytest.raises(MissingExtraError, match="the plot of bench --out"):
        result_of(bench.run(BenchRequest(out=tmp_path), fake))


def drawing(study: Study) -> ExperimentSteps:
    """Draw a number for each trial; trial 1 fails."""
    items = [Draw(study.seed + index) for index in range(study.trials or 4)]
    answers = yield from run_trials(study, "drawing", draw, items)
    rows = tuple({"seed": row["seed"], "odd": row["seed"] % 2, "share": row["share"]} for row in answers)
    return Results({"mean": sum(row["share"] for row in rows) / len(rows)}, rows, by=("odd",))


@dataclass(frozen=True)
class Draw:
    seed: int


def draw(arena: Arena, item: Draw) -> dict[str, float]:
    if item.seed % 10 == 1:
        raise InvalidInputError("one is refused")
    return {"seed": item.seed, "share": torch.rand(1, generator=torch.Generator().manual_seed(item.seed)).item()}


@pytest.fixture
def drawn() -> Iterator[None]:
    experiment_catalog.register(Experiment("drawing", drawing, "draws", quick=3, headline=("mean",)))
    yield
    EXPERIMENTS.unregister("drawing")


def files_of(folder: Path) -> dict[str, bytes]:
    """Contents of the files of a folder, without times."""
    found = {path.name: path.read_bytes() for path in folder.iterdir()}
    trials = [json.loads(line) for line in found["results.jsonl"].splitlines()]
    kept = [{name: value for name, value in trial.items() if not name.endswith("_s")} for trial in trials]
    return found | {"results.jsonl": json.dumps(kept).encode()}


@pytest.mark.usefixtures("drawn")
def test_a_failed_trial_is_a_line_with_its_seed_and_reason(tmp_path: Path) -> None:
    done = result_of(experiment.run(ExperimentRequest("drawing", out=tmp_path)))
    failed = {"place": "stonehenge", "work": "drawing", "trial": 1, "seed": 1, "reason": "one is refused"}
    assert done.summary["failed"] == [failed]
    assert "| stonehenge | drawing | 1 | 1 | one is refused |" in (tmp_path / "table.md").read_text()
    percentiles = json.loads((tmp_path / "results.json").read_text())["percentiles"]
    shares = [draw(open_arena("stonehenge"), Draw(seed))["share"] for seed in (0, 2)]
    even = next(row for row in percentiles if row["odd"] == 0)
    assert list(even) == ["odd", "measure", "n", "p5", "p25", "median", "p75", "p95"]
    assert (even["measure"], even["n"], even["median"]) == ("share", 2, pytest.approx(sum(shares) / 2))


@pytest.mark.usefixtures("drawn")
def test_where_no_trial_works_the_reason_is_the_error() -> None:
    with pytest.raises(InvalidInputError, match="none of 1 trials worked: one is refused"):
        result_of(experiment.run(ExperimentRequest("drawing", trials=1, seed=1)))


@pytest.mark.usefixtures("drawn")
@pytest.mark.parametrize("cut", [0, 1, 60, 10**6])
def test_an_interrupted_experiment_ends_as_one_that_was_not(tmp_path: Path, cut: int) -> None:
    whole, resumed = tmp_path / "whole", tmp_path / "resumed"
    result_of(experiment.run(ExperimentRequest("drawing", out=whole)))
    resumed.mkdir()
    (resumed / "manifest.json").write_bytes((whole / "manifest.json").read_bytes())
    lines = (whole / "results.jsonl").read_bytes()
    (resumed / "results.jsonl").write_bytes(lines[: len(lines) // 2][:cut] if cut < 10**6 else lines)
    events = [*experiment.run(ExperimentRequest("drawing", out=resumed))]
    remarks = [event.sentence for event in events if isinstance(event, Remark)]
    assert len(remarks) == (cut in (1, 60)) and all("which was cut" in remark for remark in remarks)
    assert files_of(resumed) == files_of(whole)


@pytest.mark.usefixtures("drawn")
@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"name": "counting"}, "holds the experiment drawing, not counting"),
        ({"trials": 2}, "was begun with trials by default, not 2"),
        ({"seed": 7}, "was begun with seed 0, not 7"),
        ({"place": "playground"}, "was begun with place by default, not playground"),
        ({"sweep": (("seed=1,2",),)}, "was begun with sweep by default"),
    ],
)
def test_a_folder_that_was_begun_otherwise_is_refused(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    result_of(experiment.run(ExperimentRequest("drawing", out=tmp_path)))
    before = files_of(tmp_path)
    with pytest.raises(InvalidInputError, match=f"{tmp_path} {message}.*: give another folder"):
        result_of(experiment.run(replace(ExperimentRequest("drawing", out=tmp_path), **change)))
    assert files_of(tmp_path) == before


@pytest.mark.usefixtures("drawn")
@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda text: text[: len(text) // 2], "not readable as JSON"),
        (lambda text: "", "not readable as JSON"),
        (lambda text: "[]", "manifest.json"),
        (lambda text: text.replace('"seed": 0', '"seed": 1'), "was changed after it was written"),
        (lambda text: text.replace('"code": "', '"code": "0'), "other code of the same version"),
        (lambda text: text.replace('"version": "', '"version": "9.'), "was begun by version 9."),
    ],
)
def test_a_damaged_or_foreign_manifest_is_refused(tmp_path: Path, spoil: Callable[[str], str], message: str) -> None:
    result_of(experiment.run(ExperimentRequest("drawing", out=tmp_path)))
    manifest = tmp_path / "manifest.json"
    manifest.write_text(spoil(manifest.read_text()))
    with pytest.raises(InvalidInputError, match=f"{message}.*[:;] give another folder"):
        result_of(experiment.run(ExperimentRequest("drawing", out=tmp_path)))


@pytest.mark.usefixtures("drawn")
def test_a_folder_is_taken_by_one_process_at_a_time_and_only_with_its_manifest(tmp_path: Path) -> None:
    first = experiment.run(ExperimentRequest("drawing", out=tmp_path))
    next(first)
    with pytest.raises(OutputError, match="another process writes into"):
        result_of(experiment.run(ExperimentRequest("drawing", out=tmp_path)))
    result_of(first)
    (tmp_path / "manifest.json").unlink()
    with pytest.raises(InvalidInputError, match=r"holds results without manifest\.json"):
        result_of(experiment.run(ExperimentRequest("drawing", out=tmp_path)))


@pytest.mark.usefixtures("drawn")
def test_a_request_that_was_refused_leaves_no_claim_on_the_folder(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="there are 20 tasks"):
        result_of(experiment.run(ExperimentRequest("planners", trials=21, out=tmp_path)))
    assert result_of(experiment.run(ExperimentRequest("drawing", out=tmp_path))).files


@pytest.mark.usefixtures("drawn")
def test_a_disk_that_takes_no_more_is_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(journal: Journal, end: TrialEnd) -> TrialEnd:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Journal, "add", full)
    with pytest.raises(OutputError, match=r"cannot write .*: No space left on device"):
        result_of(experiment.run(ExperimentRequest("drawing", out=tmp_path)))


@pytest.mark.usefixtures("drawn")
def test_quick_has_its_own_number_of_trials(tmp_path: Path) -> None:
    result_of(experiment.run(ExperimentRequest("drawing", quick=True, out=tmp_path)))
    assert json.loads((tmp_path / "manifest.json").read_text())["settings"]["trials"] == 3
    with pytest.raises(InvalidInputError, match="drop it, or drop --trials"):
        result_of(experiment.run(ExperimentRequest("drawing", quick=True, trials=2)))


@pytest.mark.usefixtures("drawn")
def test_a_sweep_is_one_table_one_figure_and_one_manifest(tmp_path: Path) -> None:
    request = ExperimentRequest("drawing", trials=2, sweep=(("seed=4,6", "place=stonehenge"),), out=tmp_path)
    done = result_of(experiment.run(request))
    assert list(done.summary["sweep"]) == ["seed=4, place=stonehenge", "seed=6, place=stonehenge"]
    rows = list(csv.DictReader((tmp_path / "drawing.csv").open()))
    found = [(row["sweep_seed"], row["seed"], row["sweep_place"]) for row in rows]
    assert found == [(str(first), str(first + index), "stonehenge") for first in (4, 6) for index in (0, 1)]
    assert {path.name for path in done.files if path.suffix in (".png", ".svg")} == {"sweep.png", "sweep.svg"}
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    assert manifest["settings"]["sweep"] == [*done.summary["sweep"]]
    again = [*experiment.run(request)]
    assert [event.fraction for event in again if isinstance(event, Progress)] == [0.0, 0.5, 1.0]


@pytest.mark.slow
def test_the_number_of_jobs_changes_no_number(tmp_path: Path) -> None:
    for name, jobs in (("one", 1), ("two", 2)):
        result_of(experiment.run(ExperimentRequest("estimation", trials=2, jobs=jobs, out=tmp_path / name)))
    one, two = ((tmp_path / name / "results.json").read_bytes() for name in ("one", "two"))
    assert one == two

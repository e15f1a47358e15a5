"""All experiments in one folder: what is written, what is skipped with a reason, and the page beside the paper."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from nerfnav.core.errors import InvalidInputError
from nerfnav.experiments import FlightOptions
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.moving.crossing import summarize as summary_of_crossings
from nerfnav.experiments.moving.experiment import summarize as summary_of_moving
from nerfnav.experiments.study import ExperimentSteps, Results, Study, run_trials
from nerfnav_app.jobs.events import Progress
from nerfnav_app.jobs.measure import claims, series
from nerfnav_app.jobs.measure.catalog import EXPERIMENTS, Experiment
from nerfnav_app.jobs.measure.experiment import ExperimentRequest, Measured
from nerfnav_app.storage.output_files import OutputError
from tests.app.following import result_of

ERRORS = ("position_rmse_m", "rotation_rmse_rad", "velocity_rmse_mps", "rate_rmse_radps")


def estimating(study: Study) -> ExperimentSteps:
    """Estimate better than the baseline, but for the last error."""
    rows = yield from run_trials(study, "estimating", estimate, list(range(study.trials or 4)))
    methods = {"nerfnav": (1.0, 1.0, 1.0, 3.0), "inerf": (2.0, 2.0, 2.0, 2.0)}
    return Results({"methods": {name: dict(zip(ERRORS, errors, strict=True)) for name, errors in methods.items()}},
                   tuple(rows))  # fmt: skip


def estimate(arena: Arena, item: int) -> dict[str, int]:
    return {"trial": item, "square": item * item}


def side_by_side(study: Study) -> ExperimentSteps:
    """Measure times, which nothing may disturb."""
    assert study.jobs is None, "it runs alone"
    return (yield from estimating(study))


def lacking(study: Study) -> ExperimentSteps:
    yield from ()
    raise InvalidInputError("it needs wings")


def broken(study: Study) -> ExperimentSteps:
    yield from ()
    raise RuntimeError("wires crossed")


@pytest.fixture(autouse=True)
def known(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    entries = (
        Experiment("estimation", estimating, "pose filters", quick=3),
        Experiment("times", side_by_side, "times", quick=1, alone=True),
        Experiment("wings", lacking, "needs wings"),
        Experiment("wires", broken, "breaks"),
    )
    monkeypatch.setattr(EXPERIMENTS, "_entries", {entry.name: entry for entry in entries})
    yield


def test_every_experiment_has_a_folder_and_one_that_cannot_run_a_reason(tmp_path: Path) -> None:
    request = ExperimentRequest("all", quick=True, out=tmp_path, jobs=1)
    events = series.run(request)
    progress = [event for event in events if isinstance(event, Progress)]
    shares = [event.fraction for event in progress]
    assert shares == sorted(shares) and progress[0].label.startswith("1 of 4, estimation: ")
    summary = json.loads((tmp_path / "results.json").read_text())["summary"]
    assert set(summary) == {"experiments", "wall_s"}
    counts = {name: (entry.get("trials"), entry.get("failed")) for name, entry in summary["experiments"].items()}
    assert counts == {"estimation": (3, 0), "times": (1, 0), "wings": (None, None), "wires": (None, None)}
    assert summary["experiments"]["wings"] == {"skipped": "it needs wings"}
    assert summary["experiments"]["wires"] == {"skipped": "RuntimeError: wires crossed"}
    assert {path.name for path in (tmp_path / "estimation").iterdir()} == {
        "manifest.json", "results.jsonl", "results.json", "estimation.csv", "table.md",
    }  # fmt: skip
    page = (tmp_path / "results.md").read_text()
    assert "| wings | – | – | – | – | – | it needs wings |" in page
    worse = '- estimation: "Lower error of body rate [rad/s] than iNeRF with dynamics" does not hold: 3 here, 2 there.'
    assert worse in page
    assert "| estimation | 3 | Lower error of position [m] than iNeRF with dynamics | 2 | 1 | yes |" in page
    assert "| estimation | Lower error of position [m] than iNeRF with dynamics | 2 | 1 | yes |" in page


def test_the_same_command_goes_on_and_another_one_is_refused(tmp_path: Path) -> None:
    request = ExperimentRequest("all", quick=True, out=tmp_path)
    first = result_of(series.run(request))
    trials = (tmp_path / "estimation" / "results.jsonl").read_bytes()
    assert result_of(series.run(request)).summary == first.summary
    assert (tmp_path / "estimation" / "results.jsonl").read_bytes() == trials
    with pytest.raises(InvalidInputError, match="was begun with seed 0, not 1"):
        result_of(series.run(replace(request, seed=1)))
    with pytest.raises(InvalidInputError, match="was begun with quick true, not false"):
        result_of(series.run(replace(request, quick=False)))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"out": None}, "name it with --out"),
        ({"sweep": (("seed=1",),)}, "name one to sweep"),
        ({"flights": FlightOptions()}, "to change flights"),
        ({"trials": 3}, "drop it, or drop --trials"),
    ],
)
def test_options_that_all_cannot_take_are_refused(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        result_of(series.run(replace(ExperimentRequest("all", quick=True, out=tmp_path), **change)))


def test_a_disk_that_takes_no_more_ends_the_series(tmp_path: Path) -> None:
    (tmp_path / "estimation").write_text("")
    with pytest.raises(OutputError, match="cannot write into the folder"):
        result_of(series.run(ExperimentRequest("all", quick=True, out=tmp_path)))


def test_every_comparison_reads_the_summary_of_its_experiment() -> None:
    loops = {"closed": {"reached": 9, "trials": 10, "collided": 0}, "open": {"reached": 1, "trials": 10, "collided": 4}}
    costs = {"collision_mean": 1.0, "collision_median": 1.0, "effort_mean": 2.0, "failures": 0}
    methods = {
        "nerfnav": {"clean": 9, "trials": 9, "time_p50_ms": 58.0, "J_median": 2.8},
        "flask": {"clean": 5, "trials": 9, "time_p50_ms": 10.0, "J_median": None},
        "vamp": {"skipped": "not installed"},
    }
    easy, hard = ({"successes": count, "worlds": 10} for count in (10, 4))
    corridors = {"announced": {"knows": "all", "easy": hard, "hard": easy}, "rrt": {"easy": easy, "hard": hard}}
    of_ten, none = ([{"clean": count, "trials": 10} for count in (2, 9)], {"clean": 0, "trials": 0})
    crossings = {
        "unaware": {"pace_0.3": of_ten[0], "pace_1": of_ten[1]},
        "announced": {"pace_0.3": of_ten[1], "pace_1": of_ten[0]},
        "seen_in_view": {"pace_0.3": none},
    }
    summaries: dict[str, Any] = {
        "timing": {
            "rows": {"plan": {"paper_s": 20.0, "nerfnav_ms": 50.0}, "filter": {"paper_s": 4.0, "nerfnav_ms": 5e3}}
        },
        "planners": {"nerfnav": costs, "rrt": costs},
        "replanning": {"together": loops},
        "collision-correlation": {"spearman_median": None},
        "ground-robots": {"gap_overlap_m3": 0.0, "gap_overlap_held_m3": 1e-3, "wheel_lateral_speed_max_mps": 0.2},
        "tangent-plane": {
            "from_1_rad": {n: {"final_rotation_rad_median": v} for n, v in (("recursive", 0.1), ("single plane", 0.2))}
        },
        "flights": {"reached": 3, "trials": 4},
        "rivals": {"methods": methods, "left_out": {"figures": "no matplotlib"}},
        "relocalisation": {"sighted": {"trials": 5, "found_and_right": 4, "found_but_wrong": 0}},
        "basin": {"2 cm": {"converged_share": 1.0}, "9 cm": {"converged_share": 0.4}, "left_out": {"figures": "none"}},
        "reflight": {"mellinger": {"exports": 6, "clean": 5}},
        "moving": {"methods": {**corridors, "flask": {"skipped": "not installed"}}},
        "crossing": {"together": crossings},
        "new": {"reached": 3},
    }
    found = {name: claims.claims_of(name, summary) for name, summary in summaries.items()}
    assert {name: [claim.holds for claim in mine] for name, mine in found.items()} == {
        "timing": [True, False], "planners": [False, False, False, True], "replanning": [True, True],
        "collision-correlation": [False], "ground-robots": [True, False], "tangent-plane": [True], "flights": [None],
        "rivals": [True, False], "relocalisation": [None], "basin": [None], "reflight": [None],
        "moving": [True, False], "crossing": [True, False], "new": [],
    }  # fmt: skip
    assert all(claim.holds for claim in claims.claims_of("moving", summary_of_moving([], {})))
    assert claims.claims_of("crossing", {"together": summary_of_crossings([])}) == []
    assert found["flights"][0].here == "3 of 4" and found["basin"][0].here == "100%, 40%"


def test_a_run_without_a_worse_number_says_so() -> None:
    manifest = series.make_manifest("all", {"seed": 3}, {})
    page = claims.write_page(manifest, {"times": Measured({"a": 1}, (), (), None)})
    assert "Nowhere in these comparisons." in page and "seed 3" in page and manifest.version in page


def test_the_time_left_counts_the_work_of_this_run_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr(series.time, "monotonic", lambda: now[0])
    clock, entry = series._Clock(), EXPERIMENTS["estimation"]
    now[0] = 0.1
    assert clock.with_time_left(Progress("one", 0.5), entry, {}) == Progress("1 of 4, estimation: one", 0.125)
    now[0] = 10.1  # an eighth of the work in 10 s, and three quarters are left
    later = Progress("1 of 4, estimation: one, 1 min left", 0.25)
    assert clock.with_time_left(Progress("one", 1.0), entry, {}) == later

"""`nerfnav experiment` and `nerfnav bench` as typed."""

import json
from pathlib import Path

import pytest

from nerfnav_app.cli.main import main
from nerfnav_app.jobs.measure.catalog import EXPERIMENTS


@pytest.mark.slow
def test_an_experiment_prints_its_summary_and_writes_its_folder(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["experiment", "planners", "--trials", "1", "--json", "--out", str(tmp_path)]) == 0
    out, err = capsys.readouterr()
    summary = json.loads(out.splitlines()[-1])
    assert set(summary) == {"nerfnav", "minsnap", "rrt"}
    assert summary["nerfnav"]["failures"] == 0
    assert {path.name for path in tmp_path.iterdir()} == {
        "manifest.json", "results.jsonl", "results.json", "planners.csv", "planners.png", "planners.svg", "table.md",
    }  # fmt: skip
    assert json.loads((tmp_path / "results.json").read_text())["summary"] == summary
    assert "results.json" in err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["experiment", "nothing"], "there is no experiment named 'nothing'"),
        (["experiment", "al"], "known are: all, basin"),
        (["experiment", "planners", "--trials", "21"], "there are 20 tasks"),
        (["experiment", "planners", "--jobs", "0"], "nerfnav: --jobs must be 1 or more, not 0"),
        (["experiment", "flights", "--risk-weight", "-1"], "nerfnav: --risk-weight must be a number, at least 0"),
        (["experiment", "flights", "--ends", "all"], "Expected one of both, random, tasks; see `nerfnav"),
        (["experiment", "planners", "--truth"], "takes no options of whole flights, only flights, replanning do"),
        (["experiment", "replanning", "--truth"], "drop --truth"),
        (["experiment", "replanning", "--trials", "-1"], "nerfnav: --trials must be 1 or more, not -1"),
        (["experiment", "nothing", "--truth"], "there is no experiment named 'nothing'"),
        (["experiment", "timing", "--jobs", "2"], "leave out --jobs and --ray"),
        (["experiment", "timing", "--fly-on"], "takes no options of whole flights"),
        (["experiment", "all"], "name it with --out"),
        (["experiment", "all", "--trials", "-1", "--out", "all"], "nerfnav: --trials must be 1 or more, not -1"),
        (["experiment", "flights", "--seed", "-1"], "nerfnav: --seed must be from 0 to 4294967295, not -1"),
        (["experiment", "all", "--truth", "--out", "all"], "name one to sweep, to change flights"),
        (["experiment", "planners", "--quick", "--trials", "2"], "drop it, or drop --trials"),
        (["experiment", "planners", "--sweep", "sed=1"], "--sweep has no setting 'sed', the nearest is seed"),
        (["experiment", "planners", "--sweep", "world=paper"], "takes no options of whole flights, only flights"),
        (["experiment", "flights", "--sweep", "seed=1", "--sweep", "seed=2"], "--sweep has seed twice"),
        (["experiment", "flights", "--sweep", "risk-weight=-1", "seed=2"], "must be a number, at least 0"),
        (["bench", "--place", "nowhere"], "'nowhere'"),
    ],
)
def test_bad_input_is_refused_in_one_sentence(
    words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words) == 2
    out, err = capsys.readouterr()
    assert out == "" and message in err and len(err.strip().splitlines()) == 1


def test_the_help_of_the_command_names_every_experiment(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["experiment", "--help"]) == 0
    assert ",".join(EXPERIMENTS) in "".join(capsys.readouterr().out.split())


@pytest.mark.slow
@pytest.mark.parametrize("planner", ["minsnap", "rrt"])
def test_a_baseline_plans_and_prints_what_other_planners_print(
    planner: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["plan", "stonehenge", "--planner", planner, "--paper-cost", "--json"]) == 0
    summary = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert main(["plan", "stonehenge", "--planner", "fast", "--paper-cost", "--json"]) == 0
    fast = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert set(summary) == set(fast)
    assert summary["outcome"] == "converged"
    assert summary["mesh_overlap_m3"] == 0
    assert summary["cost"]["control"] > fast["cost"]["control"]

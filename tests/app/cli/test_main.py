"""The command line is a contract: what it prints, what it refuses, and how."""

import json
import os
import socket
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import trimesh

from nerfnav import robots
from nerfnav.core.errors import InvalidInputError, NerfnavError
from nerfnav.core.kernel_cache import KernelCacheWarning
from nerfnav.navigation.episode import Episode
from nerfnav.planner import RISK, planners
from nerfnav.planner.planners.fast import FastPlanner
from nerfnav.planner.planners.paper import PaperPlanner
from nerfnav.planner.risk.probability import RESOLUTION
from nerfnav_app.cli.main import COMMANDS, main, parse
from nerfnav_app.jobs.events import JobEvents
from nerfnav_app.jobs.fly.request import FlyRequest
from nerfnav_app.places.place import Place
from tests.app.doubles import balls_place

Capture = pytest.CaptureFixture[str]
FROM, TO = ["--start", "-0.6", "0", "0.5"], ["--goal", "0.6", "0.1", "0.5", "1.57"]
QUICK = ["--planner", "paper", "--iterations", "5"]
QUICK_FLIGHT = ["--planner", "paper", "--plan.iterations", "10", "--replan.iterations", "3"]
QUICK_FLIGHT += ["--filter.descent.iterations", "3"]


def run(words: list[str], capture: Capture) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of one command line."""
    code = main(words)
    out, err = capture.readouterr()
    return code, out, err


def printed(words: list[str], capture: Capture) -> dict[str, Any]:
    """The object that a command prints with --json as its last line, having succeeded."""
    code, out, err = run([*words, "--json"], capture)
    assert code == 0, err
    return json.loads(out.splitlines()[-1])


def refused(words: list[str], capture: Capture) -> str:
    """The one sentence with which a command refuses its input."""
    code, out, err = run(words, capture)
    assert code == 2
    assert out == ""
    assert err.startswith("nerfnav: ")
    assert len(err.strip().splitlines()) == 1, err
    return err


def keys(summary: dict[str, Any]) -> dict[str, Any]:
    """The names in a summary, nested as they are."""
    return {name: keys(value) if isinstance(value, dict) else None for name, value in summary.items()}


def test_help_lists_every_command_and_comes_at_once(capsys: Capture) -> None:
    code, out, _ = run(["--help"], capsys)
    assert code == 0
    assert all(f"  {name} " in out for name in COMMANDS)
    light = (
        "import sys; from nerfnav_app.cli.main import main; main(['--help']); "
        "assert not {'torch', 'viser'} & set(sys.modules)"
    )
    command, root = [sys.executable, "-c", light], Path(__file__).parents[3]
    done = subprocess.run(command, capture_output=True, text=True, cwd=root)
    assert done.returncode == 0, done.stderr


def test_without_a_command_the_app_opens_stonehenge() -> None:
    for words in ([], ["serve"], ["serve", "stonehenge"]):
        command, arguments = parse(words)
        assert command.__name__ == "nerfnav_app.cli.commands.serve"
        assert (arguments.place, arguments.host, arguments.port) == ("stonehenge", "127.0.0.1", 8080)
    assert parse(["--open", "--port", "8090"])[1].open


def test_a_warning_of_nerfnav_is_one_sentence_and_others_name_their_place(
    monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    def warn(arguments: Any) -> None:
        warnings.warn("a folder cannot be written", KernelCacheWarning, stacklevel=1)
        warnings.warn("of a library", UserWarning, stacklevel=1)

    monkeypatch.setattr("nerfnav_app.cli.commands.scenes.run", warn)
    monkeypatch.setattr(warnings, "showwarning", lambda message, *rest, **more: print(message, file=sys.stderr))
    assert main(["scenes"]) == 0
    assert capsys.readouterr().err == "nerfnav: a folder cannot be written\nof a library\n"


def test_scenes_lists_the_ten_tasks_of_the_authors_and_the_headline(capsys: Capture) -> None:
    listed = {scene["name"]: scene for scene in printed(["scenes"], capsys)["scenes"]}
    assert {"stonehenge", "blocks"} <= set(listed)
    tasks = listed["stonehenge"]["tasks"]
    assert len(tasks) == 16
    assert [tasks[10]["robot"], tasks[11]["robot"]] == ["quadrotor", "diffdrive"]
    assert tasks[0]["start"] == [0.55, -0.02, 0.1]
    assert tasks[10]["goal"] == [-0.4, 0.55, 0.16]
    code, out, _ = run(["scenes"], capsys)
    assert code == 0
    assert "0.55 -0.02 0.1" in out


def test_info_tells_what_a_field_holds(field_file: Path, capsys: Capture) -> None:
    reported = printed(["info", str(field_file)], capsys)
    assert reported["box"] == {"lower": [-1, -1, 0], "upper": [1, 1, 1]}
    assert reported["resolution"] == [41, 41, 21]
    assert reported["psnr_db"] == 30.0
    assert reported["source"] == "a test"
    assert reported["file_bytes"] == field_file.stat().st_size
    code, out, _ = run(["info", str(field_file)], capsys)
    assert code == 0
    assert "30 dB" in out


def test_info_judges_the_shape_of_a_field_by_a_mesh_and_takes_a_picture(
    field_file: Path, tmp_path: Path, capsys: Capture
) -> None:
    mesh = tmp_path / "column.ply"
    column = trimesh.creation.box((0.4, 0.4, 1.0)).apply_translation([0, 0, 0.5])
    floor = trimesh.creation.box((2.0, 2.0, 0.05)).apply_translation([0, 0, 0.025])
    trimesh.util.concatenate([column, floor]).export(mesh)
    picture = tmp_path / "picture.png"
    reported = printed(["info", str(field_file), "--mesh", str(mesh), "--png", str(picture)], capsys)
    geometry = reported["geometry"]
    assert geometry["voxel_m"] == reported["voxel_m"]
    assert geometry["surface_points"] > 0 and geometry["free_points"] > 0
    assert geometry["free_clear"] == 1
    assert 0.05 < geometry["surface_depth_1"] < 0.5  # the field has the column and no floor
    assert cv2.imread(str(picture)).std() > 1
    assert "no mesh file" in refused(["info", str(field_file), "--mesh", "atlantis"], capsys)
    words = tmp_path / "words.ply"
    words.write_text("no mesh at all")
    assert "is not a PLY file" in refused(["info", str(field_file), "--mesh", str(words)], capsys)


def test_doctor_finds_working_kernels(capsys: Capture) -> None:
    reported = printed(["doctor"], capsys)
    assert reported["kernels"]["agree"] is True
    assert reported["threads"] >= 1
    assert reported["retraction"] in ("nerfnav", "LieTorch")


def test_plan_prints_the_numbers_of_its_contract_and_writes_its_files(
    field_file: Path, tmp_path: Path, capsys: Capture
) -> None:
    words = [*FROM, *TO, *QUICK, "--steps", "20", "--out", str(tmp_path / "new" / "run")]
    plan = printed(["plan", str(field_file), *words], capsys)
    assert keys(plan) == {
        "outcome": None,
        "iterations": None,
        "wall_s": None,
        "cost": {"collision": None, "control": None, "total": None},
        "collision_probability_bound": None,
        "collision_probability": None,
        "expected_sigma": dict.fromkeys(("median_m", "p95_m", "max_m", "blind_share")),
        "mesh_overlap_m3": None,
        "max_thrust_n": None,
        "max_body_rate": None,
        "duration_s": None,
        "limits": {
            name: dict.fromkeys(("least", "most", "lower", "upper", "unit", "violated"))
            for name in ("thrust", "tilt", "speed", "body rate")
        },
        "safety": dict.fromkeys(("bound", "bound_per_step_max", "min_clearance_m", "worst_step")),
    }
    assert plan["iterations"] == 5
    assert plan["mesh_overlap_m3"] is None, "this field has no ground truth"
    assert plan["max_thrust_n"] > 1
    assert json.loads((tmp_path / "new" / "run" / "plan.json").read_text()) == plan
    rows = np.genfromtxt(tmp_path / "new" / "run" / "trajectory.csv", delimiter=",", names=True)
    assert [rows[0][f"{name}_m"] for name in "xyz"] == pytest.approx([-0.6, 0, 0.5])
    assert [rows[-1][f"{name}_m"] for name in "xyz"] == pytest.approx([0.6, 0.1, 0.5])
    assert 2 * np.arctan2(rows[-1]["qz"], rows[-1]["qw"]) == pytest.approx(1.57)


def test_a_plan_in_a_bundled_scene_is_judged_on_its_mesh(capsys: Capture) -> None:
    plan = printed(["plan", "stonehenge", "--task", "0", "--planner", "paper", "--iterations", "2"], capsys)
    assert isinstance(plan["mesh_overlap_m3"], float)


def test_settings_are_those_of_the_planner_that_is_asked_for(field_file: Path, capsys: Capture) -> None:
    words = ["plan", str(field_file), *FROM, *TO, "--steps", "20"]
    few = printed([*words, "--newton.iterations", "2"], capsys)
    assert few["outcome"] == "iteration_limit"
    same = printed([*words, "--planner=paper", "--iterations", "3"], capsys)
    assert same["iterations"] == 3
    assert "--iterations" in refused([*words, "--iterations", "3"], capsys)


@pytest.mark.parametrize(
    ("words", "first", "again"),
    [
        (["--plan.newton.iterations", "7"], 7, 7),
        (["--plan.newton.iterations", "7", "--replan.newton.iterations", "9"], 7, 9),
        (["--planner", "paper", "--plan.iterations", "2000"], 2000, 250),
        (["--planner=paper", "--replan.iterations", "5"], 2500, 5),
    ],
)
def test_a_flight_is_planned_as_the_command_line_says(
    words: list[str], first: int, again: int, monkeypatch: pytest.MonkeyPatch, field_file: Path
) -> None:
    asked: list[FlyRequest] = []

    def remembered(request: FlyRequest, place: Place) -> JobEvents:
        asked.append(request)
        raise InvalidInputError("enough")
        yield

    monkeypatch.setattr("nerfnav_app.cli.commands.fly.run_job", remembered)
    assert main(["fly", str(field_file), *FROM, *TO, *words]) == 2
    (route,) = (request.route for request in asked)
    field, entry = balls_place().field, planners.load(route.planner)
    planner = entry.planner(field, robots.load("quadrotor"), route.settings, route.again)
    assert isinstance(planner, PaperPlanner | FastPlanner)
    assert (planner.first.iterations, planner.again.iterations) == (first, again)


def test_the_fast_planner_of_a_flight_has_the_settings_of_the_command_line(
    field_file: Path, capsys: Capture, tmp_path: Path
) -> None:
    words = ["fly", str(field_file), *FROM, *TO, "--open-loop", "--out"]
    heavy = ["--plan.weights.control", "1000"]
    lengths = []
    for number, more in enumerate(([], heavy)):
        folder = tmp_path / str(number)
        printed([*words, str(folder), *more], capsys)
        lengths.append(Episode.load(folder).plans[0].actions.square().sum().item())
    assert lengths[0] != lengths[1], "the weight of effort changes what is flown"
    assert "--plan.seed" in refused(["fly", str(field_file), *FROM, *TO, "--plan.seed", "2"], capsys)


def test_the_duration_can_be_given_or_found(field_file: Path, capsys: Capture) -> None:
    words = ["plan", str(field_file), *FROM, *TO, "--duration"]
    assert printed([*words, "1.25"], capsys)["duration_s"] == pytest.approx(1.25)
    found = printed([*words, "auto"], capsys)
    assert found["duration_s"] < 2
    assert not any(limit["violated"] for limit in found["limits"].values())
    assert ": --duration must be a number above 0" in refused([*words, "-1"], capsys)


def test_a_bound_that_cannot_be_met_is_said_to_be_missed_by_how_much(field_file: Path, capsys: Capture) -> None:
    words = ["plan", str(field_file), *FROM, *TO, "--max-collision"]
    safe = printed([*words, "0.5"], capsys)
    assert safe["outcome"] == "converged" and safe["collision_probability_bound"] <= 0.5
    risky = printed([*words, "1e-12"], capsys)
    assert risky["outcome"] == "too_risky"
    assert risky["safety"]["missed_by"] == pytest.approx(max(risky["collision_probability"], RESOLUTION), rel=1e-6)


def test_a_plan_or_flight_with_too_little_to_see_is_refused_before_take_off(
    field_file: Path, tmp_path: Path, capsys: Capture
) -> None:
    words = [str(field_file), "--start", "0.6", "0", "0.5", "--goal", "0.6", "0.3", "0.5", "--paper-cost", "--json"]
    words.append("--max-blind")
    assert "--max-blind must be a share, from 0 to 1, not 1.5" in refused(["plan", *words, "1.5"], capsys)
    for command in (["plan"], ["fly", "--out", str(tmp_path)]):
        code, out, err = run([command[0], *words, "0.1", *command[1:]], capsys)
        numbers = json.loads(out)
        share = numbers["expected_sigma"]["blind_share"]
        assert code == 0 and numbers["outcome"] == "too_risky" and share > 0.1
        assert f"too little to see on {100 * share:.0f} % of the way, more than the 10 % that are accepted: " in err
        assert len(err.strip().splitlines()) == 1
    assert numbers["steps"] == 0
    physical = ["plan", *words[:-2], "--max-blind", "0.5", "--world", "physical"]
    assert "leave out --max-blind" in refused(physical, capsys)


def test_noise_counts_in_a_plan_unless_the_cost_of_the_paper_is_asked_for(field_file: Path, capsys: Capture) -> None:
    words = ["plan", str(field_file), *FROM, *TO]
    calm, careful = printed([*words, "--paper-cost"], capsys), printed([*words, "--risk-weight", "30"], capsys)
    assert "risk" not in calm["cost"] and "expected_by_noise" not in calm["safety"]
    assert careful["cost"]["risk"] == pytest.approx(30 * careful["safety"]["expected_by_noise"])
    default = printed(words, capsys)
    assert default["cost"]["risk"] == pytest.approx(RISK * default["safety"]["expected_by_noise"])
    assert "--risk-weight must be a number, at least 0, not -1" in refused([*words, "--risk-weight", "-1"], capsys)
    assert "leave out --risk-weight" in refused([*words, "--risk-weight", "1", "--paper-cost"], capsys)


def test_without_json_a_plan_is_told_in_words(field_file: Path, capsys: Capture) -> None:
    code, out, err = run(["plan", str(field_file), *FROM, *TO, *QUICK], capsys)
    assert code == 0
    assert "max thrust" in out
    (remark,) = err.splitlines()
    assert remark.startswith("too little to see on"), "and no progress bar where nobody watches"


@pytest.mark.slow
def test_fly_prints_the_numbers_of_its_contract_and_its_run_can_be_exported(
    field_file: Path, tmp_path: Path, capsys: Capture
) -> None:
    flight = printed(["fly", str(field_file), *FROM, *TO, *QUICK_FLIGHT, "--out", str(tmp_path / "run")], capsys)
    assert keys(flight) == {
        "outcome": None,
        "steps": None,
        "final_position_error_m": None,
        "mesh_collision_steps": None,
        "silent": None,
        "late_steps": None,
        "transitions": None,
        "expected_sigma": dict.fromkeys(("median_m", "p95_m", "max_m", "blind_share")),
        "estimation": dict.fromkeys(("position_rmse_m", "rotation_rmse_rad", "velocity_rmse", "nees_mean")),
        "recoveries": dict.fromkeys(
            ("widened", "blind", "adrift", "searched", "backup", "relocalised", "lost", "landed")
        ),
        "timing_ms": {f"{part}_p{share}": None for part in ("replan", "filter", "step") for share in (50, 95)},
        "consistency": dict.fromkeys(("cause", "sentence", "noise_factor", "residual", "pictures")),
    }
    assert flight["outcome"] in ("reached", "collided", "outside", "lost", "timeout")
    assert flight["mesh_collision_steps"] is None
    assert flight["timing_ms"]["filter_p50"] > 0
    out = tmp_path / "deeper" / "flight.csv"
    exported = printed(["export", str(tmp_path / "run"), "--format", "csv", "--out", str(out)], capsys)
    assert exported["rows"] == flight["steps"] + 1
    rows = np.genfromtxt(out, delimiter=",", names=True)
    assert rows["t_s"][1] == pytest.approx(0.1)
    error = np.linalg.norm([rows[-1]["x_m"] - 0.6, rows[-1]["y_m"] - 0.1, rows[-1]["z_m"] - 0.5])
    assert error == pytest.approx(flight["final_position_error_m"], abs=1e-5)


def test_an_open_loop_flight_takes_no_pictures(field_file: Path, capsys: Capture) -> None:
    words = ["fly", str(field_file), *FROM, *TO, *QUICK_FLIGHT, "--steps", "20", "--open-loop", "--seed", "3"]
    flight = printed(words, capsys)
    assert flight["steps"] == 20
    assert flight["timing_ms"]["filter_p95"] == 0


def test_the_same_seed_gives_the_same_flight(field_file: Path, capsys: Capture) -> None:
    words = ["fly", str(field_file), *FROM, *TO, *QUICK_FLIGHT, "--open-loop", "--seed"]
    first, again, other = (printed([*words, seed], capsys)["estimation"] for seed in ("1", "1", "2"))
    assert first == again
    assert first != other


@pytest.mark.slow
def test_train_makes_a_field_that_finds_its_ground_truth_again(tmp_path: Path, capsys: Capture) -> None:
    out = tmp_path / "new" / "blocks.npz"
    quick = ["--iterations", "60", "--images", "20", "--voxel", "0.05"]
    trained = printed(["train", "blocks", "--out", str(out), *quick], capsys)
    assert set(trained) == {
        "psnr_db", "psnr_one_exposure_db", "noise_std", "train_s", "voxels", "file_bytes", "learned_from",
        "proven_from", "geometry", "in_words", "source",
    }  # fmt: skip
    assert trained["psnr_db"] > 12
    assert trained["file_bytes"] == out.stat().st_size
    # twenty pictures prove little: its start is not proven free, and the plan may be told to be unsafe
    main(["plan", str(out), "--task", "0", "--unknown", "free", *QUICK, "--json"])
    plan = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert isinstance(plan["mesh_overlap_m3"], float)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["nonsense"], "no command named 'nonsense'; known are: bake, bench, "),
        (["plan", "atlantis"], "no scene or field file named 'atlantis'; known are: apartment, blocks, church, "),
        (["fly", "atlantis"], "known are: apartment, blocks, church, playground, stonehenge"),
        (["serve", "atlantis"], "known are: apartment, blocks, church, playground, stonehenge"),
        (["train", "atlantis", "--out", "x.npz"], "known are: apartment, blocks, church, playground, stonehenge"),
        (["info", "missing.npz"], "there is no field file missing.npz"),
        (["plan", "missing.npz"], "there is no field file missing.npz"),
        (["plan", "stonehenge", "--task", "16"], "stonehenge has tasks 0 to 15, not 16"),
        (["plan", "stonehenge", "--task", "two"], "'two'"),
        (["plan", "stonehenge", "--robot", "submarine"], "no robot named 'submarine'; known are: cart, couch, "),
        (["plan", "stonehenge", "--planner", "luck"], "no planner named 'luck'; known are: "),
        (["fly", "stonehenge", "--estimator", "luck"], "no estimator named 'luck'; known are: "),
        (["plan", "stonehenge", "--start", "0", "0"], "an end is X Y Z or X Y Z YAW, not 2 numbers"),
        (["plan", "stonehenge", *FROM], "give either --task, or both --start and --goal"),
        (["plan", "stonehenge", *FROM, *TO, "--task", "1"], "give either --task, or both --start and --goal"),
        (["plan", "stonehenge", *FROM, "--goal", "nan", "0", "0.2"], "finite numbers, not of nan 0 0.2"),
        (["plan", "stonehenge", "--dt", "nan"], "--dt must be a finite number, not nan"),
        (["plan", "stonehenge", "--dt", "-1"], "nerfnav: --dt must be a number above 0, not -1"),
        (["plan", "stonehenge", "--max-collision=2"], ": --max-collision must be a probability, above 0 and at most 1"),
        (["plan", "stonehenge", "--newton.iterations", "0"], ": --newton.iterations must be a number above 0, not 0"),
        (["fly", "stonehenge", "--noise.position-m", "-1"], ": --noise.position-m must be a number, at least 0"),
        (["fly", "stonehenge", "--recovery.turn", "-1"], ": --recovery.turn must be a number, at least 0"),
        (["fly", "stonehenge", "--plan.newton.iterations", "0", "--replan.newton.iterations", "9"],
         "nerfnav: iterations must be a number above 0, not 0"),
        (["plan", "stonehenge", "--steps", "2"], "a quadrotor needs at least 4 steps"),
        (["plan", "stonehenge", "--weights.control", "inf"], "--weights.control must be a finite number"),
        (["plan", "stonehenge", "--start", "9", "0", "0.2", *TO], "outside the field, which spans x -1.30 to 1.30"),
        (["plan", "stonehenge", *FROM, *TO, "--bogus"], "Unrecognized options: --bogus"),
        (["train", "blocks"], "Missing from nerfnav train: --out"),
        (["train", "blocks", "--out", "x.npz", "--budget", "0"], ": --budget must be a number above 0, not 0"),
        (["train", "blocks", "--out", "x.npz", "--images", "3"], "images must be at least 10"),
        (["train", "blocks", "--out", "x.npz", "--images", "10", "--voxel", "1e-4"], "choose a larger --voxel"),
        (["export", "missing", "--format", "csv", "--out", "x.csv"], "missing is not the folder of a run"),
        (["serve", "--port", "70000"], "a port is a number from 1 to 65535, not 70000"),
        (["serve", "--host", "203.0.113.7"], "no network interface of this machine is called '203.0.113.7'"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)  # fmt: skip
def test_bad_input_is_refused_in_one_sentence(
    words: list[str], expected: str, capsys: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert expected in refused(words, capsys)
    assert list(tmp_path.iterdir()) == [], "nothing was begun"


@pytest.mark.parametrize(
    "words",
    [
        ["info", "POINTER.npz"],
        ["open", "POINTER.glb"],
        ["train", "POINTER.zip", "--out", "f.npz"],
        ["import", "POINTER.spz", "--out", "f.npz"],
        ["plan", "stonehenge", "--robot", "POINTER.yaml", *FROM, *TO],
        ["localize", "field.npz", "POINTER.png"],
        ["track", "field.npz", "POINTER.mp4", "--out", "run"],
    ],
    ids=lambda words: " ".join(words[:2]),
)
def test_a_pointer_of_git_lfs_is_named_for_every_argument(
    words: list[str], field_file: Path, capsys: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "field.npz").write_bytes(field_file.read_bytes())
    (name,) = (word for word in words if word.startswith("POINTER"))
    (tmp_path / name).write_text("version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 9\n")
    assert f"{name} is a pointer of Git LFS in place of the file itself" in refused(words, capsys)


def test_a_goal_inside_a_block_is_refused_with_the_nearest_free_point(field_file: Path, capsys: Capture) -> None:
    sentence = refused(["plan", str(field_file), *FROM, "--goal", "0.15", "0", "0.5"], capsys)
    assert "the goal (0.15, 0.00, 0.50) is in occupied space; the nearest free point is (0." in sentence


def test_a_field_without_a_scene_has_no_tasks(field_file: Path, capsys: Capture) -> None:
    assert "column has no tasks: give --start and --goal" in refused(["plan", str(field_file)], capsys)


def test_a_truncated_field_is_refused(field_file: Path, tmp_path: Path, capsys: Capture) -> None:
    torn = tmp_path / "torn.npz"
    torn.write_bytes(field_file.read_bytes()[:2000])
    assert "torn.npz is not a whole nerfnav field" in refused(["info", str(torn)], capsys)


def test_a_foreign_file_is_refused(tmp_path: Path, capsys: Capture) -> None:
    text, arrays = tmp_path / "notes.txt", tmp_path / "arrays.npz"
    text.write_text("not a field")
    np.savez(arrays, weights=np.zeros(3))
    for path in (text, arrays):
        assert "is not a" in refused(["plan", str(path)], capsys)
        assert "is not a" in refused(["serve", str(path)], capsys)


def test_an_unknown_format_is_refused(field_file: Path, tmp_path: Path, capsys: Capture) -> None:
    run(["plan", str(field_file), *FROM, *TO, *QUICK, "--out", str(tmp_path / "run")], capsys)
    words = ["export", str(tmp_path / "run"), "--format", "xml", "--out", str(tmp_path / "x.xml")]
    assert "no format named 'xml'; known are: ardupilot, crazyflie, csv, " in refused(words, capsys)
    assert not (tmp_path / "x.xml").exists()


@pytest.mark.parametrize("command", ["plan", "fly"])
def test_a_folder_that_cannot_be_written_is_refused(command: str, field_file: Path, capsys: Capture) -> None:
    where = str(field_file / "run")  # below a file
    assert "cannot write into the folder" in refused([command, str(field_file), *FROM, *TO, "--out", where], capsys)


def test_a_field_file_that_cannot_be_written_is_refused_before_training(tmp_path: Path, capsys: Capture) -> None:
    assert "it is a folder" in refused(["train", "blocks", "--out", str(tmp_path)], capsys)
    (tmp_path / "file").touch()
    assert "cannot write into" in refused(["train", "blocks", "--out", str(tmp_path / "file" / "x.npz")], capsys)


def test_a_taken_port_is_refused(capsys: Capture) -> None:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        listener.listen()
        port = listener.getsockname()[1]
        assert f"port {port} of 127.0.0.1 is taken" in refused(["serve", "--port", str(port)], capsys)


@pytest.mark.slow
def test_as_a_process_it_ends_with_the_exit_code_and_one_sentence() -> None:
    program = "import sys; from nerfnav_app.cli.main import main; sys.exit(main())"
    words = [sys.executable, "-c", program, "plan", "atlantis"]
    ran = subprocess.run(words, capture_output=True, text=True, cwd=Path(__file__).parents[3], env=os.environ)
    assert ran.returncode == 2
    assert ran.stdout == ""
    assert len(ran.stderr.splitlines()) == 1, ran.stderr


def test_every_error_that_is_told_is_one_of_ours() -> None:
    with pytest.raises(NerfnavError):
        parse(["plan"])

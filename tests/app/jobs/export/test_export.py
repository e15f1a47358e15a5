"""Exporting stored plans and flights, as the command line does."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from nerfnav import robots
from nerfnav.core.errors import InvalidInputError, NameTakenError
from nerfnav.export import formats
from nerfnav.export.formats import FORMATS, ExportFormat
from nerfnav.export.recording import Exported, Recording, Subject
from nerfnav.export.refusal import Remedy
from nerfnav.export.tables import json_text, motion_table
from nerfnav.field.models.analytic import BallsField
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.storage.checkpoint import load_field, save_field
from nerfnav.geometry import Box
from nerfnav.robots.state import Motion
from nerfnav_app.cli.main import main
from nerfnav_app.jobs.events import FileMade, TrajectoryRefused
from nerfnav_app.jobs.export.export import ExportRequest, download, run
from nerfnav_app.jobs.export.recording import read_run
from nerfnav_app.jobs.fly import fly
from nerfnav_app.jobs.fly.request import FlyRequest
from nerfnav_app.jobs.plan.plan import PlanRequest
from nerfnav_app.places.ends import Ends
from nerfnav_app.places.place import open_place
from nerfnav_app.storage.run_store import VARIABLE, RunStore
from nerfnav_app.storage.step_log import FILE
from tests.app.following import result_of
from tests.app.storage.stored_runs import put
from tests.export.flights import arrived, curve, flown, hover_to_hover
from tests.export.readers import poses_of_tum


def exported(folder: Path, format: str, out: Path) -> dict:
    """The numbers of an export."""
    last = result_of(run(ExportRequest(folder, format, out)))
    return last.summary


@pytest.mark.parametrize("name", FORMATS)
def test_a_stored_flight_can_be_had_in_every_format(tmp_path: Path, name: str) -> None:
    folder, out = put(RunStore(tmp_path), "flight"), tmp_path / "out" / f"flight.{FORMATS[name].ending}"
    form = FORMATS[name]
    request = ExportRequest(folder, name, out, datum=(47.4, 8.5, 500.0))
    numbers = result_of(run(request)).summary
    assert numbers["of"] == form.subjects[0].value and numbers["rows"] == 17
    if form.moves_vehicle:  # the flight touched something, its plan did not
        again = replace(request, of="executed", smooth=True)
        with pytest.raises(InvalidInputError, match=f"the executed path is not exported for {name}: the robot touched"):
            list(run(again))
        numbers = result_of(run(replace(again, force=True))).summary
    assert numbers["outcome"] == (None if numbers["of"] == "plan" else "collided")
    assert numbers["file_bytes"] == out.stat().st_size > 100


def test_a_format_from_outside_is_exported_under_its_name(tmp_path: Path) -> None:
    def rows(made: Recording) -> Exported:
        return Exported(str(len(made.times)).encode(), {"lines": 1})

    formats.register(ExportFormat("rows", "txt", "the number of rows", rows))
    try:
        numbers = exported(put(RunStore(tmp_path), "flight"), "rows", tmp_path / "rows.txt")
        with pytest.raises(NameTakenError, match="format named 'csv' already"):
            formats.register(ExportFormat("csv", "csv", "another table", rows))
    finally:
        FORMATS.unregister("rows")
    assert (numbers["format"], numbers["lines"]) == ("rows", 1)
    assert (tmp_path / "rows.txt").read_text() == "17"


def test_a_replay_shows_the_place_where_it_can_still_be_opened(tmp_path: Path, field_file: Path) -> None:
    shelf = RunStore(tmp_path)
    here, gone = put(shelf, "here", source=str(field_file)), put(shelf, "gone", source="nowhere.npz")
    assert exported(here, "html", tmp_path / "here.html")["has_surface"]
    assert not exported(gone, "html", tmp_path / "gone.html")["has_surface"]
    assert "balls" in (tmp_path / "gone.html").read_text()


def test_what_a_vehicle_is_to_fly_is_judged_in_the_field_of_its_plan_as_long_as_that_is_there(
    tmp_path: Path, field_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mine = tmp_path / "mine.npz"
    shutil.copyfile(field_file, mine)
    ends = ["--start", "-0.8", "-0.5", "0.5", "--goal", "0.8", "-0.5", "0.5"]
    assert main(["plan", str(mine), *ends, "--out", str(tmp_path / "plan"), "--json"]) == 0
    capsys.readouterr()
    reported = exported(tmp_path / "plan", "px4", tmp_path / "a.csv")["curve"]
    assert reported["outcome"] == "converged" and reported["min_clearance_m"] > 0
    blocked = load_field(mine)
    assert isinstance(blocked, VoxelField)
    blocked.values[:, :, :, 0] = 1.0
    save_field(blocked, mine)
    with pytest.raises(InvalidInputError, match="the plan is not exported for px4: its smooth curve cuts the corners"):
        exported(tmp_path / "plan", "px4", tmp_path / "b.csv")
    assert not (tmp_path / "b.csv").exists()
    mine.unlink()
    assert exported(tmp_path / "plan", "px4", tmp_path / "c.csv")["curve"] is None


def test_a_page_gets_what_was_judged_or_one_sentence() -> None:
    box, recording = Box.of((-2.0, -2.0, -1.0), (2.0, 2.0, 2.0)), hover_to_hover()
    away = recording.with_field(BallsField(box, torch.tensor([[9.0, 9.0, 9.0]]), torch.tensor([0.1])))
    (made,) = [event for event in download(away, FORMATS["px4"], "mine.csv") if isinstance(event, FileMade)]
    assert made.name == "mine.csv" and made.content.startswith(b"# px4_msgs")
    there = recording.with_field(BallsField(box, recording.position[:1].float(), torch.tensor([0.3])))
    (refused,) = [
        event for event in download(there, FORMATS["px4"], "mine.csv") if isinstance(event, TrajectoryRefused)
    ]
    assert refused.refusal.remedies == (Remedy.REPLAN, Remedy.FORCE)
    assert [e for e in download(there, FORMATS["px4"], "mine.csv", force=True) if isinstance(e, FileMade)]


def test_an_interrupted_flight_is_exported_as_far_as_it_went(tmp_path: Path) -> None:
    folder = put(RunStore(tmp_path), "flight")
    whole = (folder / FILE).read_bytes()
    (folder / FILE).write_bytes(whole[: len(whole) // 2])
    (folder / "trajectory.json").unlink(missing_ok=True)
    rows = len(read_run(folder).times)
    assert 2 < rows < 17
    exported(folder, "tum", tmp_path / "flight.tum")
    assert len(poses_of_tum((tmp_path / "flight.tum").read_text())[0]) == rows


def test_a_flight_can_be_named_as_the_shelf_has_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path / "runs"))
    out = str(tmp_path / "x.csv")
    put(RunStore(), "my flight")
    assert main(["export", "my flight", "--format", "px4-odometry", "--out", out, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["frame"] == "NED"
    assert main(["export", "other", "--format", "px4", "--out", str(tmp_path / "x.csv")]) == 2
    assert "other is not the folder of a run" in capsys.readouterr().err


def test_a_stored_flight_has_three_subjects_and_its_plan_is_the_first_one(tmp_path: Path) -> None:
    motion, shelf = curve(), RunStore(tmp_path)
    folder = put(shelf, "flight", arrived(motion), plan_outcome="converged")
    found = {of: exported_of(folder, "json", tmp_path / f"{of}.json", of) for of in ("plan", "executed", "estimate")}
    assert [numbers["outcome"] for numbers in found.values()] == ["converged", "reached", "reached"]
    positions = read_run(folder, Subject.PLAN).position
    torch.testing.assert_close(positions.float(), motion.states.position)
    assert len({path.read_bytes() for path in tmp_path.glob("*.json")}) == 3
    touches = put(shelf, "touches", arrived(motion), plan_outcome="touches_mesh")
    with pytest.raises(InvalidInputError, match="the plan is not exported for px4: the robot would touch"):
        exported(touches, "px4", tmp_path / "x.csv")


def exported_of(folder: Path, format: str, out: Path, of: str) -> dict:
    """The numbers of an export of one of the three."""
    return result_of(run(ExportRequest(folder, format, out, of=of))).summary  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--of", "executed"], "this plan was not flown, so the executed path does not exist: fly it"),
        (["--of", "everything"], "'everything' for argument '--of'. Expected one of estimate, executed, plan; "),
        (["--smooth"], "--smooth is for an executed path or an estimate that a vehicle flies: leave it out"),
        (["--format", "html"], "html needs the executed path, and a plan has none: fly it"),
    ],
)
def test_a_wrong_subject_is_refused_in_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], told: str
) -> None:
    (tmp_path / "trajectory.json").write_text(json_text(hover_to_hover().table))
    assert main(["export", str(tmp_path), "--format", "csv", "--out", str(tmp_path / "x.csv"), *words]) == 2
    said = capsys.readouterr().err
    assert told in said and len(said.splitlines()) == 1 and not (tmp_path / "x.csv").exists()


def test_the_help_says_the_default_subject_of_each_format(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export", "--help"]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert [[form.name, form.subjects[0].value] for form in FORMATS.values()] == [
        line[:2] for line in lines if line[:1] and line[0] in FORMATS and len(line) > 2
    ]


@pytest.mark.slow
@pytest.mark.parametrize("task", [0, 1, 2])
def test_after_a_flight_that_arrived_every_vehicle_gets_its_file(tmp_path: Path, task: int) -> None:
    stones, run_folder = open_place("stonehenge"), tmp_path / "run"
    wanted = stones.tasks[task]
    request = FlyRequest(PlanRequest(Ends.of_task(wanted)), task=wanted.name, source="stonehenge", out=run_folder)
    assert result_of(fly.run(request, stones)).summary["outcome"] == "reached"
    for name in ("px4", "ardupilot", "crazyflie"):
        numbers = exported(run_folder, name, tmp_path / f"{name}.csv")
        assert numbers["of"] == "plan" and numbers["curve"]["outcome"] == "converged" and numbers["off_rows_m"] < 0.05


def test_a_folder_of_something_else_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="is not the folder of a run"):
        read_run(tmp_path)


def test_a_stored_plan_has_the_body_of_its_robot(tmp_path: Path) -> None:
    motion = Motion(flown()[0].plan.states, torch.zeros(16, 2), 0.1)
    couch = robots.load("couch")
    table = motion_table(motion, ("a", "b"), couch.name)
    (tmp_path / "trajectory.json").write_text(json_text(table))
    assert read_run(tmp_path).extents == couch.body.extents

"""Exporting stored plans and flights, as the command line does."""

import json
import shutil
from pathlib import Path

import pytest
import torch

from nerfnav import robots
from nerfnav.core.errors import InvalidInputError, NameTakenError
from nerfnav.export import formats
from nerfnav.export.formats import FORMATS, ExportFormat
from nerfnav.export.recording import Exported, Recording
from nerfnav.export.tables import json_text, motion_table
from nerfnav.field.models.analytic import BallsField
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.storage.checkpoint import load_field, save_field
from nerfnav.geometry import Box
from nerfnav.robots.state import Motion
from nerfnav_app.cli.main import main
from nerfnav_app.jobs.events import FileMade
from nerfnav_app.jobs.export.export import ExportRequest, download, run
from nerfnav_app.jobs.export.recording import read_run
from nerfnav_app.storage.run_store import VARIABLE, RunStore
from nerfnav_app.storage.step_log import FILE
from tests.app.following import result_of
from tests.app.storage.stored_runs import put
from tests.export.flights import flown, hover_to_hover
from tests.export.readers import poses_of_tum


def exported(folder: Path, format: str, out: Path) -> dict:
    """The numbers of an export."""
    last = result_of(run(ExportRequest(folder, format, out)))
    return last.summary


@pytest.mark.parametrize("name", FORMATS)
def test_a_stored_flight_can_be_had_in_every_format(tmp_path: Path, name: str) -> None:
    folder, out = put(RunStore(tmp_path), "flight"), tmp_path / "out" / f"flight.{FORMATS[name].ending}"
    with pytest.raises(InvalidInputError, match="not to be flown again: the robot touched"):
        list(run(ExportRequest(folder, "px4", out)))
    last = result_of(run(ExportRequest(folder, name, out, force=True, datum=(47.4, 8.5, 500.0))))
    numbers = last.summary
    assert numbers["outcome"] == "collided" and numbers["rows"] == 17
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
    with pytest.raises(InvalidInputError, match="the curve that the vehicle would fly is not to be flown"):
        exported(tmp_path / "plan", "px4", tmp_path / "b.csv")
    assert not (tmp_path / "b.csv").exists()
    mine.unlink()
    assert exported(tmp_path / "plan", "px4", tmp_path / "c.csv")["curve"] is None


def test_a_page_gets_what_was_judged_or_one_sentence() -> None:
    box, recording = Box.of((-2.0, -2.0, -1.0), (2.0, 2.0, 2.0)), hover_to_hover()
    away = recording.with_field(BallsField(box, torch.tensor([[9.0, 9.0, 9.0]]), torch.tensor([0.1])))
    (made,) = [event for event in download(away, "px4", "mine.csv", force=False) if isinstance(event, FileMade)]
    assert made.name == "mine.csv" and made.content.startswith(b"# px4_msgs")
    there = recording.with_field(BallsField(box, recording.position[:1].float(), torch.tensor([0.3])))
    with pytest.raises(InvalidInputError, match="export it by force"):
        list(download(there, "px4", "mine.csv", force=False))
    assert [event for event in download(there, "px4", "mine.csv", force=True) if isinstance(event, FileMade)]


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


def test_a_folder_of_something_else_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="is not the folder of a run"):
        read_run(tmp_path)


def test_a_stored_plan_has_the_body_of_its_robot(tmp_path: Path) -> None:
    motion = Motion(flown()[0].plan.states, torch.zeros(16, 2), 0.1)
    couch = robots.load("couch")
    table = motion_table(motion, ("a", "b"), couch.name)
    (tmp_path / "trajectory.json").write_text(json_text(table))
    assert read_run(tmp_path).extents == couch.body.extents

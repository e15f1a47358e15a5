"""`nerfnav train` as a command line: its options, and what it refuses."""

import json
import shutil
from pathlib import Path

import pytest

from nerfnav.core.errors import NerfnavError
from nerfnav.core.jit import count_cores, default_threads
from nerfnav.importers.core.placement import MeasuredDistance, Placement
from nerfnav_app.cli.main import main, parse
from nerfnav_app.jobs.events import JobEvents, JobResult, Progress
from nerfnav_app.jobs.field.request import TrainRequest
from tests.importers.captures.synthetic import changed, write_transforms

Capture = pytest.CaptureFixture[str]


def placement(*words: str) -> Placement:
    _, arguments = parse(["train", "room", "--out", "room.npz", *words])
    return arguments.placement.placement()


def test_nothing_said_is_nothing_known() -> None:
    assert placement() == Placement()


def test_up_is_a_direction_or_an_axis() -> None:
    assert placement("--up", "y").up == (0, 1, 0)
    assert placement("--up", "0", "-1", "0.5").up == (0, -1, 0.5)


def test_two_picked_points_and_a_distance_are_seven_numbers_and_a_box_is_six() -> None:
    words = ["--picked", "0", "0", "-1", "0", "3", "3", "2.5", "--box", "-1", "-1", "0", "1", "1", "2"]
    picked = MeasuredDistance((0, 0, -1), (0, 3, 3), 2.5)
    assert placement(*words) == Placement(picked=picked, box=((-1, -1, 0), (1, 1, 2)))
    assert placement(*words).meters_per_unit == 0.5


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--up", "north"], "up is made of numbers"),
        (["--up", "1", "2"], "up takes 3 numbers, not 2"),
        (["--box", "1", "2", "nan", "4", "5", "6"], "box is made of finite numbers"),
        (["--picked", "1", "2"], "picked takes 7 numbers, not 2"),
        (["--scale", "-1"], "scale must be a number above 0"),
        (["--scale", "1", "--picked", "0", "0", "0", "1", "0", "0", "1"], "either a scale or two picked points"),
    ],
)
def test_what_no_placement_can_be_is_refused(words: list[str], message: str) -> None:
    with pytest.raises(NerfnavError, match=message):
        placement(*words)


@pytest.mark.parametrize(("words", "expected"), [([], count_cores()), (["--threads", "1"], 1)])
def test_training_takes_all_cores_or_as_many_threads_as_it_is_given(
    words: list[str], expected: int, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    def count_threads(request: TrainRequest) -> JobEvents:
        yield Progress("training", 0.5)
        return JobResult({"threads": default_threads()})

    before = default_threads()
    monkeypatch.setattr("nerfnav_app.cli.commands.train.run_job", count_threads)
    assert main(["train", "blocks", "--out", "f.npz", "--json", *words]) == 0
    assert json.loads(capsys.readouterr().out)["threads"] == expected and default_threads() == before


@pytest.mark.parametrize("threads", ["0", "-1", "1000000"])
def test_threads_that_there_are_not_are_refused(threads: str, capsys: Capture) -> None:
    assert "threads must be a" in refused(["train", "blocks", "--out", "f.npz", "--threads", threads], capsys)


def refused(words: list[str], capture: Capture) -> str:
    code = main(words)
    out, err = capture.readouterr()
    assert (code, out) == (2, "") and err.startswith("nerfnav: ") and len(err.strip().splitlines()) == 1
    return err


@pytest.mark.slow
def test_a_capture_is_trained_from_and_what_was_guessed_is_printed(tmp_path: Path, capsys: Capture) -> None:
    room = write_transforms(tmp_path / "room")
    words = ["train", str(room), "--out", str(tmp_path / "room.npz"), "--iterations", "5", "--voxel", "0.3"]
    assert main([*words, "--json"]) == 0
    printed = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert set(printed) == {
        "psnr_db", "train_s", "voxels", "file_bytes", "learned_from", "proven_from", "geometry", "in_words",
        "source", "psnr_one_exposure_db", "noise_std", "input_keys",
    }  # fmt: skip
    assert {"kind", "images_used", "images_skipped", "scale", "up", "box", "guesses"} <= set(printed["source"])
    assert main([*words, "--downscale", "2", "--held-out-every", "3", "--scale", "2"]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "source scale 2" in text and "images held out 3" in text and "from how the cameras were held" in text


@pytest.mark.parametrize("name", ["empty.zip", "letter.zip", "empty.json", "letter.json", "cut.zip", "folder", "one"])
def test_captures_that_cannot_be_used_are_refused_in_one_sentence(tmp_path: Path, capsys: Capture, name: str) -> None:
    source, room = tmp_path / name, write_transforms(tmp_path / "room")
    if name == "folder":
        source.mkdir()
    elif name == "one":
        changed(room, lambda said: said.update(frames=said["frames"][:1])).rename(source)
    elif name == "cut.zip":
        source.write_bytes(Path(shutil.make_archive(str(room), "zip", room)).read_bytes()[:-200])
    else:
        source.write_text("" if name.startswith("empty") else "Dear reader")
    assert name in refused(["train", str(source), "--out", str(tmp_path / "f.npz")], capsys) or name == "one"
    assert not (tmp_path / "f.npz").exists()

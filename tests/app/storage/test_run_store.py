"""The shelf lists, renames and deletes flights, and touches nothing else."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from nerfnav.core.errors import InvalidInputError, UnknownNameError
from nerfnav.navigation.episode import Episode
from nerfnav_app.places.uploads import NameRefusedError
from nerfnav_app.storage.output_files import OutputError
from nerfnav_app.storage.run_store import RunStore, checked
from nerfnav_app.storage.step_log import FILE, StepLog
from tests.app.storage.stored_runs import about, put
from tests.export.flights import flown
from tests.waiting import PATIENCE_S

BAD_NAMES = ["", ".", "..", "../x", "a/b", "a\\b", "/etc", ".hidden", "a" * 81, "x\n", "x.", "x ", "Ü", "a\0b"]


@pytest.fixture
def shelf(tmp_path: Path) -> RunStore:
    return RunStore(tmp_path / "runs")


def test_flights_are_listed_with_the_newest_first(shelf: RunStore) -> None:
    put(shelf, "old", date="2026-01-01T00:00:00+00:00")
    put(shelf, "new", date="2026-02-01T00:00:00+00:00")
    assert [entry.name for entry in shelf.entries()] == ["new", "old"]
    entry = shelf.entries()[0]
    assert (entry.outcome, entry.steps, entry.metadata.seed) == ("collided", 16, 3)


def test_an_empty_shelf_and_folders_of_other_things_list_nothing(shelf: RunStore) -> None:
    assert shelf.entries() == ()
    (shelf.folder / "plan").mkdir(parents=True)
    (shelf.folder / "plan" / "trajectory.json").write_text("{}")
    (shelf.folder / "broken").mkdir()
    (shelf.folder / "broken" / FILE).write_text("{}\n")
    (shelf.folder / "broken" / "run.json").write_text("nonsense")
    assert shelf.entries() == ()


def test_a_flight_without_an_end_is_flying_while_it_is_written_and_interrupted_after(shelf: RunStore) -> None:
    folder = shelf.new("balls")
    log = StepLog(folder, about(), Episode.metrics)
    for step in flown()[:6]:
        log.append(step)
    (entry,) = shelf.entries()
    assert (entry.outcome, entry.steps) == ("flying", 5)
    for refused in (lambda: shelf.delete(entry.name), lambda: shelf.rename(entry.name, "other")):
        with pytest.raises(InvalidInputError, match="is being flown"):
            refused()
    log._lock.release()  # as when the program dies
    (entry,) = shelf.entries()
    assert (entry.outcome, entry.steps) == ("interrupted", 5)


def test_new_flights_of_one_second_have_folders_of_their_own(shelf: RunStore) -> None:
    made = {shelf.new("../a place/with: odd name") for _ in range(5)}
    assert len(made) == 5 and all(folder.parent == shelf.folder for folder in made)
    assert all(checked(folder.name) for folder in made)


def test_a_shelf_that_cannot_be_written_says_so(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot write into the folder of flights: let NERFNAV_RUNS name another"):
        RunStore(tmp_path / "file").new("balls")


def test_a_renamed_flight_keeps_everything(shelf: RunStore) -> None:
    put(shelf, "first")
    shelf.rename("first", "My best flight")
    assert [entry.name for entry in shelf.entries()] == ["My best flight"]
    assert len(shelf.steps("My best flight")) == 17 and shelf.steps("My best flight")[1].image is not None
    shelf.rename("My best flight", "My best flight")


@pytest.mark.parametrize("name", BAD_NAMES)
def test_bad_names_are_refused_everywhere(shelf: RunStore, name: str) -> None:
    put(shelf, "first")
    for refused in (
        lambda: shelf.rename("first", name),
        lambda: shelf.rename(name, "other"),
        lambda: shelf.delete(name),
        lambda: shelf.steps(name),
    ):
        with pytest.raises(NameRefusedError, match="a name has up to 80 letters"):
            refused()
    assert [entry.name for entry in shelf.entries()] == ["first"]


def test_a_name_that_is_taken_is_refused(shelf: RunStore) -> None:
    put(shelf, "first")
    put(shelf, "second")
    with pytest.raises(NameRefusedError, match="already something called 'second'"):
        shelf.rename("first", "second")


def test_a_deleted_flight_is_gone_and_nothing_else_is(shelf: RunStore, tmp_path: Path) -> None:
    put(shelf, "first")
    put(shelf, "second")
    (tmp_path / "precious").write_text("x")
    shelf.delete("first")
    assert [entry.name for entry in shelf.entries()] == ["second"]
    assert not (shelf.folder / "first").exists() and (tmp_path / "precious").exists()
    with pytest.raises(UnknownNameError, match="no flight named 'first'; known are: second"):
        shelf.delete("first")


def test_a_link_that_leads_out_of_the_shelf_is_no_flight(shelf: RunStore, tmp_path: Path) -> None:
    outside = put(RunStore(tmp_path / "elsewhere"), "flight")
    shelf.folder.mkdir()
    (shelf.folder / "link").symlink_to(outside)
    assert shelf.entries() == ()
    with pytest.raises(UnknownNameError):
        shelf.delete("link")
    assert (outside / FILE).is_file()


def test_a_folder_that_holds_no_flight_is_never_deleted(shelf: RunStore) -> None:
    (shelf.folder / "photos").mkdir(parents=True)
    (shelf.folder / "photos" / "one.jpg").write_text("x")
    with pytest.raises(UnknownNameError):
        shelf.delete("photos")
    assert (shelf.folder / "photos" / "one.jpg").exists()


@pytest.mark.slow
def test_a_program_that_is_killed_in_flight_leaves_all_steps_so_far(shelf: RunStore, field_file: Path) -> None:
    words = [
        "fly", str(field_file), "--start", "-0.6", "-0.6", "0.5", "--goal", "0.6", "-0.6", "0.5",
        "--filter.descent.iterations", "40",  # so that it is still in flight when it is looked at
    ]  # fmt: skip
    command = [sys.executable, "-c", f"from nerfnav_app.cli.main import main; main({words!r})"]
    environment = {**os.environ, "NERFNAV_RUNS": str(shelf.folder), "OMP_NUM_THREADS": "1"}
    program = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    try:
        end = time.monotonic() + 5 * PATIENCE_S  # on a new machine its kernels are compiled first
        while not any(entry.steps >= 3 for entry in shelf.entries()):
            assert program.poll() is None, program.stderr and program.stderr.read().decode()
            assert time.monotonic() < end, "the flight did not begin"
            time.sleep(0.02)
        (entry,) = shelf.entries()
        assert entry.outcome == "flying"
    finally:
        program.send_signal(signal.SIGKILL)
        program.communicate()
    (entry,) = shelf.entries()
    steps = shelf.steps(entry.name)
    assert entry.outcome == "interrupted" and entry.steps >= 3
    assert [step.index for step in steps] == list(range(entry.steps + 1))
    assert steps[-1].image is not None and steps[-1].outcome is None

"""What a terminal shows of a job, and what Ctrl-C does to it."""

import json
import os
import pty
import signal
import subprocess
import sys
from collections.abc import Generator, Iterator
from contextlib import suppress
from pathlib import Path
from threading import Thread

import pytest

from nerfnav_app.cli.progress import run_and_print, run_with_progress
from nerfnav_app.cli.terminal import show
from nerfnav_app.jobs.events import JobEvents, JobResult, Progress
from tests.waiting import PATIENCE_S


@pytest.fixture(autouse=True)
def _heeds_interrupts() -> Iterator[None]:
    """Whoever runs the tests in the background has interrupts ignored, and the tests inherit that."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def counting(total: int, interrupt_at: int | None = None) -> JobEvents:
    """A job of `total` steps that the user interrupts at one of them; says how far it came."""
    done = 0
    for index in range(total):
        if index == interrupt_at:
            signal.raise_signal(signal.SIGINT)
        done += 1
        if (yield Progress("counting", done / total)):
            break
    return JobResult({"done": done})


def test_a_job_is_followed_to_its_end() -> None:
    assert run_with_progress(counting(3)).summary == {"done": 3}


def test_a_job_is_told_under_its_title_when_it_ends(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_and_print("count", counting(3), as_json=False).summary == {"done": 3}
    assert [line.split() for line in capsys.readouterr().out.splitlines()] == [["count"], ["done", "3"]]
    run_and_print("count", counting(2), as_json=True)
    assert json.loads(capsys.readouterr().out) == {"done": 2}


def test_rows_of_numbers_are_told_one_by_one(capsys: pytest.CaptureFixture[str]) -> None:
    show("bench", {"runs": [{"budget_s": 30.0, "psnr_db": 26.5}, {"budget_s": 120.0, "psnr_db": None}]}, False)
    lines = [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()[1:]]
    assert lines == ["runs 1 budget 30 s", "runs 1 psnr 26.5 dB", "runs 2 budget 120 s", "runs 2 psnr none"]


def test_an_interrupt_asks_a_job_that_can_stop_early_to_do_so(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_with_progress(counting(9, interrupt_at=2), can_stop_early=True).summary == {"done": 3}
    assert "keeping what was done so far" in capsys.readouterr().err
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_an_interrupt_ends_a_job_that_cannot_stop_early() -> None:
    with pytest.raises(KeyboardInterrupt):
        run_with_progress(counting(9, interrupt_at=2))


def test_a_second_interrupt_ends_every_job() -> None:
    def stubborn() -> JobEvents:
        yield Progress("counting", 0.0)
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)
        yield Progress("counting", 1.0)
        return JobResult()

    with pytest.raises(KeyboardInterrupt):
        run_with_progress(stubborn(), can_stop_early=True)


def test_what_is_no_number_becomes_null_in_json(capsys: pytest.CaptureFixture[str]) -> None:
    show("x", {"a": float("nan"), "b": [1.5, float("inf")], "c": {"d": None, "e": True}}, as_json=True)
    assert json.loads(capsys.readouterr().out) == {"a": None, "b": [1.5, None], "c": {"d": None, "e": True}}


def test_words_have_units(capsys: pytest.CaptureFixture[str]) -> None:
    show("x", {"timing_ms": {"p50": 1.0}, "wall_s": 2.5, "outcome": "reached", "count": 1, "good": True}, as_json=False)
    lines = [line.split() for line in capsys.readouterr().out.splitlines()[1:]]
    assert ["wall", "2.5", "s"] in lines
    assert ["outcome", "reached"] in lines
    assert ["count", "1"] in lines
    assert ["good", "yes"] in lines


def until(stream: int, word: str) -> Generator[str, None, None]:
    """What a process writes, piece by piece, until it has written `word`."""
    seen = ""
    while word not in seen:
        try:
            piece = os.read(stream, 4096).decode(errors="replace")
        except OSError as error:  # nobody writes there any more
            raise AssertionError(f"it ended before it wrote {word!r}: {seen}") from error
        seen += piece
        yield piece


def drain(stream: int) -> None:
    """Read what a process writes until it ends."""
    with suppress(OSError):
        while os.read(stream, 4096):
            pass


@pytest.mark.slow
def test_a_training_that_is_interrupted_keeps_what_it_learned(tmp_path: Path) -> None:
    out = tmp_path / "field.npz"
    words = ["train", "blocks", "--out", str(out), "--iterations", "1000000", "--images", "10", "--voxel", "0.05"]
    program = "import sys; from nerfnav_app.cli.main import main; sys.exit(main())"
    command = [sys.executable, "-c", program, *words, "--json"]
    terminal, stderr = pty.openpty()
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=stderr, cwd=Path(__file__).parents[3]) as process:
        os.close(stderr)
        shown = "".join(until(terminal, "k rays/s"))
        process.send_signal(signal.SIGINT)
        shown += "".join(until(terminal, "keeping what was done so far"))
        rest = Thread(target=drain, args=(terminal,))  # a terminal that nobody reads is full after 4 KB
        rest.start()
        summary, _ = process.communicate(timeout=5 * PATIENCE_S)
    rest.join()
    os.close(terminal)
    assert process.returncode == 0
    assert "PSNR" in shown
    assert json.loads(summary)["file_bytes"] == out.stat().st_size


def test_people_are_told_the_unknown_keys_of_an_input_and_programs_all(capsys: pytest.CaptureFixture[str]) -> None:
    keys = {"used": ["frames"], "ignored": {"scale": "no reason"}, "unknown": ["frames[].foo", "bar"]}
    show("a field", {"voxels": 3, "input_keys": keys}, as_json=False)
    table = capsys.readouterr().out
    assert "frames[].foo, bar" in table and "no reason" not in table
    show("a field", {"voxels": 3, "input_keys": {**keys, "unknown": []}}, as_json=False)
    assert "keys" not in capsys.readouterr().out
    show("a field", {"voxels": 3, "input_keys": keys}, as_json=True)
    assert json.loads(capsys.readouterr().out)["input_keys"] == keys

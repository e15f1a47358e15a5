"""Help fits a screen, says what each option takes, and hides nothing that `--help-all` does not list."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from nerfnav.planner import planners
from nerfnav.planner.planners.planner import RISK
from nerfnav_app.cli.help import MOST_LINES, WIDTH
from nerfnav_app.cli.main import COMMANDS, PIPE_CLOSED, main

Capture = pytest.CaptureFixture[str]
ROOT = Path(__file__).parents[3]
PLANNED = [[command, "--planner", planner] for command in ("plan", "fly") for planner in planners.names()]
EACH = pytest.mark.parametrize("words", [*([name] for name in COMMANDS), *PLANNED], ids=" ".join)


def printed(words: list[str], capture: Capture) -> list[str]:
    assert main(words) == 0
    return capture.readouterr().out.splitlines()


@EACH
def test_help_fits_a_screen(words: list[str], capsys: Capture) -> None:
    lines = printed([*words, "--help"], capsys)
    assert lines[0].startswith(f"usage: nerfnav {words[0]} ")
    assert len(lines) <= MOST_LINES and max(map(len, lines)) <= WIDTH
    assert any(line.startswith("  --json ") for line in lines)
    assert lines == printed([*words, "-h"], capsys)


@EACH
def test_help_says_what_options_take_as_people_know_it(words: list[str], capsys: Capture) -> None:
    text = "\n".join(printed([*words, "--help-all"], capsys))
    assert max(map(len, text.splitlines())) <= WIDTH
    assert not re.search(r"\{|None\||\b(STR|PATH)\b|--config|\(default: (None|False|)\)|│", text)


@EACH
def test_all_that_help_leaves_out_is_in_help_all(words: list[str], capsys: Capture) -> None:
    def options(lines: list[str]) -> list[str]:
        return [line.split()[0] for line in lines if line.startswith("  --")]

    some, every = printed([*words, "--help"], capsys), printed([*words, "--help-all"], capsys)
    missing = len(options(every)) - len(options(some))
    assert set(options(some)) <= set(options(every)) and len(set(options(every))) == len(options(every))
    assert (some[-1] == f"{missing} more options: nerfnav {words[0]} --help-all") == (missing > 0)


def test_help_has_defaults_and_what_must_be_given(capsys: Capture) -> None:
    text = " ".join(" ".join(printed(["train", "--help"], capsys)).split())
    assert "usage: nerfnav train SOURCE --out FILE [OPTIONS]" in text
    assert "--out FILE File for the field (required)" in text
    assert "--quality draft|good|best" in text and "(default: good)" in text
    assert "--up X Y Z|AXIS" in text and "--units m|cm|mm|in|ft" in text


def test_what_a_collision_by_noise_costs_in_flight_is_what_its_option_says(capsys: Capture) -> None:
    text = " ".join(" ".join(printed(["fly", "--help"], capsys)).split())
    assert f"{RISK:g} for the fast planner" in text


def test_a_mistyped_old_option_is_refused_and_not_called_renamed(capsys: Capture) -> None:
    assert main(["plan", "stonehenge", "--config.rsik", "3"]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and "is now" not in err


def test_an_old_option_works_and_is_warned_of_on_stderr(field_file: Path, capsys: Capture) -> None:
    ends = ["--start", "-0.6", "0", "0.5", "--goal", "0.6", "0.1", "0.5"]
    words = ["plan", str(field_file), *ends, "--planner", "paper", "--steps", "20", "--json"]
    assert main([*words, "--config.iterations", "2"]) == 0
    out, err = capsys.readouterr()
    assert '"iterations": 2' in out
    told = "nerfnav: --config.iterations is now --iterations: the next release removes the old name"
    assert err.splitlines()[0] == told


@pytest.mark.slow
@pytest.mark.parametrize("words", [["fly", "--help-all"], ["--help"]], ids=" ".join)
def test_a_reader_that_has_enough_ends_help_silently(words: list[str]) -> None:
    read, write = os.pipe()
    os.close(read)
    command = [sys.executable, "-c", "import sys; from nerfnav_app.cli.main import main; sys.exit(main())", *words]
    path = os.pathsep.join([str(ROOT), str(ROOT / "packaging")])
    done = subprocess.run(command, stdout=write, stderr=subprocess.PIPE, env=os.environ | {"PYTHONPATH": path})
    os.close(write)
    assert (done.returncode, done.stderr) == (PIPE_CLOSED, b"")

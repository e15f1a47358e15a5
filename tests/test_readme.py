"""README and docs: commands are understood, and scripts run as written."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from nerfnav_app.cli.main import parse

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()
PAGES = {path.relative_to(ROOT).as_posix(): path.read_text() for path in sorted((ROOT / "docs").rglob("*.md"))}
MOST_WORDS = 700


def blocks(language: str, text: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)


def commands_in(text: str) -> list[list[str]]:
    """Return the words after `nerfnav` of every command in a page."""
    lines = [line for block in blocks("sh", text) for line in block.splitlines()]
    parts = [shlex.split(part, comments=True) for line in lines for part in line.split("&&")]
    return [words[1:] for words in parts if words and Path(words[0]).name == "nerfnav"]


@pytest.mark.parametrize("words", [w for text in (README, *PAGES.values()) for w in commands_in(text)], ids=" ".join)
def test_every_command_is_understood(words: list[str]) -> None:
    command, arguments = parse(words)
    kind = command.OpenArguments if words[:2] == ["bench", "open"] else command.Arguments
    assert isinstance(arguments, kind)


def test_the_page_of_commands_has_every_command() -> None:
    commands = commands_in(PAGES["docs/command_line.md"])
    assert {words[0] for words in commands if words and not words[0].startswith("-")} == {
        "scenes", "plan", "fly", "export", "train", "import", "bake", "info", "map", "place", "open", "localize",
        "track", "live", "experiment", "report", "bench", "serve", "doctor", "calibrate",
    }  # fmt: skip


def test_readme_fits_on_a_page_and_a_half_and_links_every_page() -> None:
    prose = [line for line in README.splitlines() if not line.startswith("|")]
    assert len(" ".join(prose).split()) <= MOST_WORDS
    assert set(re.findall(r"\]\((docs/[^)#]+)\)", README)) == set(PAGES)


def test_the_results_of_readme_are_the_first_table_of_their_page() -> None:
    table = re.search(r"(?:^\|.*\n)+", PAGES["docs/results.md"], re.MULTILINE)
    assert table is not None and table.group() in README


@pytest.mark.slow
def test_the_script_plans_and_flies() -> None:
    (script,) = blocks("python", README)
    assert len([line for line in script.splitlines() if line]) <= 12 and "assert" not in script
    code = f"{script}\nimport sys\nassert 'sympy' not in sys.modules, 'half a second of imports'"
    ran = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert ran.returncode == 0, ran.stderr
    assert "PlanOutcome.CONVERGED" in ran.stdout
    assert "overlap with the true stones: 0.0 m^3" in ran.stdout
    assert re.search(r"flight: reached, position error \d+\.\d mm RMS", ran.stdout), ran.stdout


@pytest.mark.parametrize("text", [*blocks("python", README), *blocks("py", PAGES["docs/scripting.md"])])
def test_a_script_imports_the_front_of_nerfnav_only(text: str) -> None:
    imported = [line for line in text.splitlines() if line.startswith(("import ", "from "))]
    assert imported[:2] == ["import nerfnav", "import nerfnav_scenes as scenes"]
    assert imported[2:] in ([], ["import torch"])


def test_the_filter_alone_follows_a_camera(capsys: pytest.CaptureFixture[str]) -> None:
    (block,) = blocks("py", PAGES["docs/scripting.md"])
    pictures = 2
    camera = (
        "from nerfnav.field import render_image\n"
        "from nerfnav.geometry import FORWARD_MOUNT\n"
        "def your_camera():\n"
        "    pose = nerfnav.RigidState.at_rest((-0.89, 0.005, 0.3)).pose.compose(FORWARD_MOUNT)\n"
        "    return (255 * render_image(estimator.field, camera, pose).color.clamp(0, 1)).round().to(torch.uint8)\n"
    )
    exec(block.replace("while True:", f"{camera}for _ in range({pictures}):"), {})
    assert capsys.readouterr().out.count("UPDATED tensor([-0.89") == pictures

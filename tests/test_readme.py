"""README's commands and script run as written."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from nerfnav_app.cli.main import parse

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)


def commands() -> list[list[str]]:
    """The words after `nerfnav` of every command in README."""
    lines = [line for block in blocks("sh") for line in block.splitlines()]
    parts = [shlex.split(part, comments=True) for line in lines for part in line.split("&&")]
    return [words[1:] for words in parts if words and Path(words[0]).name == "nerfnav"]


@pytest.mark.parametrize("words", commands(), ids=" ".join)
def test_every_command_is_understood(words: list[str]) -> None:
    command, arguments = parse(words)
    assert isinstance(arguments, command.Arguments)


def test_there_are_commands_for_every_part() -> None:
    assert {words[0] for words in commands() if words and not words[0].startswith("-")} == {
        "scenes", "plan", "fly", "export", "train", "import", "bake", "info", "map", "place", "open", "localize",
        "track", "live", "experiment", "bench", "serve", "doctor",
    }  # fmt: skip


@pytest.mark.slow
def test_the_script_prints_a_plan() -> None:
    (script,) = blocks("python")
    assert len([line for line in script.splitlines() if line]) <= 8
    ran = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert ran.returncode == 0, ran.stderr
    assert "PlanOutcome.CONVERGED" in ran.stdout
    assert "overlap with the true stones: 0.0 m^3" in ran.stdout


@pytest.mark.parametrize("language", ["python", "py"])
def test_a_script_needs_nothing_of_nerfnav_but_its_front(language: str) -> None:
    (script,) = blocks(language)
    imported = [line for line in script.splitlines() if line.startswith(("import ", "from "))]
    assert imported in (["import nerfnav, scenes"], ["import nerfnav, scenes, torch"])


def test_every_folder_of_the_tree_exists() -> None:
    tree = re.findall(r"^ {4,6}(\w+)/ ", README, re.MULTILINE)
    assert len(tree) >= 13
    for name in tree:
        assert (ROOT / name).is_dir() or (ROOT / "nerfnav" / name).is_dir(), name


def test_every_file_that_is_named_exists() -> None:
    for name in re.findall(r"\b((?:static|tests|nerfnav|scenes)/[\w/]+\.\w+)", README):
        assert (ROOT / name).is_file(), name


def test_the_filter_alone_follows_a_camera(capsys: pytest.CaptureFixture[str]) -> None:
    (block,) = blocks("py")
    pictures = 2
    camera = (
        "from nerfnav.field.render.volume_rendering import render_image\n"
        "from nerfnav.geometry.camera import FORWARD_MOUNT\n"
        "from nerfnav.robots.state import RigidState\n"
        "def your_camera():\n"
        "    pose = RigidState.at_rest((-0.89, 0.005, 0.3)).pose.compose(FORWARD_MOUNT)\n"
        "    return (255 * render_image(estimator.field, camera, pose).color.clamp(0, 1)).round().to(torch.uint8)\n"
    )
    exec(block.replace("while True:", f"{camera}for _ in range({pictures}):"), {})
    assert capsys.readouterr().out.count("UPDATED tensor([-0.89") == pictures

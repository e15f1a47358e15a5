"""Import names: folders `app/`, `scenes/` and `tests/` of other people, first on PYTHONPATH, change nothing."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from nerfnav_app.cli.main import COMMANDS

_PROGRAM = "import sys; from nerfnav_app.cli.main import main; sys.exit(main())"
_EXPLAIN_ALL = """import sys
from nerfnav_app.cli.main import main
sys.exit(max(main([name, "--help"]) for name in sys.argv[1:]))"""
"""One process for all: most of the time goes into the imports, which they share."""


@pytest.fixture(scope="module")
def foreign_environment(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """An environment whose PYTHONPATH begins with a folder that has an `app`, a `scenes` and a `tests` of its own."""
    folder = tmp_path_factory.mktemp("workspace")
    for name in ("app", "scenes", "tests"):
        (folder / name).mkdir()
        (folder / name / "__init__.py").write_text("raise ImportError('this folder is not nerfnav')\n")
    ours = [path for path in sys.path if path]
    return {**os.environ, "PYTHONPATH": os.pathsep.join((str(folder), *ours))}


def _ran(environment: dict[str, str], folder: Path, *words: str, program: str = _PROGRAM) -> str:
    command = [sys.executable, "-c", program, *words]
    done = subprocess.run(command, env=environment, cwd=folder, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
def test_every_subcommand_explains_itself(foreign_environment: dict[str, str], tmp_path: Path) -> None:
    explained = _ran(foreign_environment, tmp_path, *COMMANDS, program=_EXPLAIN_ALL)
    assert all(f"usage: nerfnav {name}" in explained for name in COMMANDS)


@pytest.mark.slow
def test_scenes_are_listed_and_planned_in(foreign_environment: dict[str, str], tmp_path: Path) -> None:
    listed = json.loads(_ran(foreign_environment, tmp_path, "scenes", "--json").splitlines()[-1])
    assert "stonehenge" in {scene["name"] for scene in listed["scenes"]}
    planned = json.loads(_ran(foreign_environment, tmp_path, "plan", "stonehenge", "--json").splitlines()[-1])
    assert planned["outcome"] == "converged"

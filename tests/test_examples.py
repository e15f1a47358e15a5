"""Examples: each script runs unchanged, prints what it promises, and imports from faces only."""

import ast
import importlib
import re
import subprocess
import sys
from pathlib import Path

import pytest
import torch

from tests.test_imports import FACES, names_on_face, package_path
from tests.waiting import free_port

FOLDER = Path(__file__).parents[1] / "examples"
NUMBER = r"(-?\d+(?:\.\d+)?(?:e[-+]\d+)?)"
PROMISES = {
    "plan": [r"20 actions in 2\.0 s", r"overlap with the stones 0\.0e\+00 m\^3"],
    "own_cost": [r"without the term: converged", r"with the term: converged", r"overlap with the stones 0\.0e\+00"],
    "own_robot": [r"converged: J", r"it ends 0\.\d+ mm off", r"overlap 0\.0e\+00 m\^3"],
    "filter_camera": [r"step 2: updated, off by [0-9]\.\d mm"],
    "fly": [r"reached after \d\.\d s", r"touched in 0 steps", r"NEES"],
    "moved_object": [r"ball beside the path: converged", r"ball in the path: converged"],
    "own_capture": [r"held-out views", r"\d+ bytes"],
    "export": [r"px4\.csv", r"crazyflie\.csv", r"duration: 2\.0 s"],
    "judge_mesh": [r"through the wall: touches first in step \d+", r"over the wall: touches nothing; .* 0 cm\^3"],
    "own_viewer": [r"goal at 0\.16 m: the cost has settled", r"http://localhost:\d+"],
}
"""Patterns that the output of each script must match."""
OPTIONS = {
    "filter_camera": ["--steps", "3"],
    "own_capture": ["--images", "20", "--iterations", "60"],
    "export": ["--out", "exported"],
    "own_viewer": ["--seconds", "1", "--port", "18090"],
}
LIVE = {"ros2_node", "mavsdk_offboard"}
"""Clients of `nerfnav live` and of a vehicle: tests/live/test_examples.py runs them."""
SERVING = {"drag_goal"}
"""Pages that run until Ctrl-C: a test of its own calls their functions."""
LONGEST = {"drag_goal": 50}
"""Lines of an example, 90 for all others."""


def output_of(name: str, folder: Path) -> str:
    """Run an example in an empty folder and return its output."""
    command = [sys.executable, str(FOLDER / f"{name}.py"), *OPTIONS.get(name, [])]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=500)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("name", PROMISES)
def test_an_example_runs_and_prints_what_it_promises(name: str, tmp_path: Path) -> None:
    printed = output_of(name, tmp_path)
    for promise in PROMISES[name]:
        assert re.search(promise, printed), printed
    if name == "own_cost":
        low = [float(number) for number in re.findall(rf"by {NUMBER} m in all", printed)]
        assert low[1] < 0.2 * low[0], "the term keeps the robot low"
    if name == "moved_object":
        (_, away), radius = re.findall(rf"at {NUMBER} cm", printed), re.findall(rf"is {NUMBER} cm", printed)
        assert float(away) > float(radius[0]), "the second plan passes the ball"


@pytest.mark.slow
def test_a_plan_follows_the_goal_that_a_hand_drags(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(FOLDER))
    page = importlib.import_module("drag_goal").DragGoalPage(free_port())
    page.update()
    first = page.motion
    for goal in ((-0.39, 0.5, 0.2), (-0.38, 0.45, 0.25)):  # two moves during one plan: the newest counts
        page.goal.position = goal
        page.moved.set()
    page.update()
    assert torch.allclose(page.motion.states.position[-1], torch.tensor(goal))
    assert (page.motion.states.position - first.states.position).norm(dim=-1).max() > 0.1
    assert not page.moved.is_set()
    page.goal.position = (9.0, 9.0, 9.0)
    followed = page.motion
    page.moved.set()
    page.update()
    page.server.stop()
    assert page.motion is followed, "a goal that cannot be reached keeps the last plan"


def test_all_examples_are_tested_and_begin_with_a_docstring() -> None:
    scripts = sorted(FOLDER.glob("*.py"))
    assert {path.stem for path in scripts} == set(PROMISES) | LIVE | SERVING
    for path in scripts:
        text = path.read_text()
        assert text.startswith('"""') and len(text.splitlines()) <= LONGEST.get(path.stem, 90), path.name


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.py")), ids=lambda path: path.stem)
def test_an_example_imports_from_faces_only(path: Path) -> None:
    faces = {package_path(stub): names_on_face(stub) for stub in FACES}
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            ours = {alias.name for alias in node.names if alias.name.startswith("nerfnav")}
            assert ours <= {"nerfnav", "nerfnav_scenes"}
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("nerfnav"):
            assert {alias.name for alias in node.names} <= faces[node.module or ""], node.module

"""Every script in examples/ runs as it stands, and prints what it promises."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[1] / "examples"
NUMBER = r"(-?\d+(?:\.\d+)?(?:e[-+]\d+)?)"
PROMISES = {
    "plan": [r"20 actions in 2\.0 s", r"overlap with the stones 0\.0e\+00 m\^3"],
    "own_cost": [r"without the term: converged", r"with the term: converged", r"overlap with the stones 0\.0e\+00"],
    "own_robot": [r"converged: J", r"it ends 0\.\d+ mm off", r"overlap 0\.0e\+00 m\^3"],
    "filter_camera": [r"step 2: updated, off by [0-9]\.\d mm"],
    "fly": [r"reached after \d\.\d s", r"touched in 0 steps", r"NEES"],
    "moved_object": [r"ball beside the way: converged", r"ball in the way: converged"],
    "own_capture": [r"held-out views", r"\d+ bytes"],
    "export": [r"px4\.csv", r"crazyflie\.csv", r"duration: 2\.0 s"],
    "judge_mesh": [r"through the wall: touches first in step \d+", r"over the wall: touches nothing; .* 0 cm\^3"],
    "own_viewer": [r"goal at 0\.16 m: the cost has settled", r"http://localhost:\d+"],
}
"""What each script's output must match."""
OPTIONS = {
    "filter_camera": ["--steps", "3"],
    "own_capture": ["--images", "20", "--iterations", "60"],
    "export": ["--out", "exported"],
    "own_viewer": ["--seconds", "1", "--port", "18090"],
}


LIVE = {"ros2_node", "mavsdk_offboard"}
"""They talk to `nerfnav live` and to a vehicle: tests/live/test_examples.py runs them."""


def ran(name: str, folder: Path) -> str:
    """What an example prints, run in an empty folder."""
    command = [sys.executable, str(FOLDER / f"{name}.py"), *OPTIONS.get(name, [])]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=500)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("name", PROMISES)
def test_an_example_runs_and_prints_what_it_promises(name: str, tmp_path: Path) -> None:
    printed = ran(name, tmp_path)
    for promise in PROMISES[name]:
        assert re.search(promise, printed), printed
    if name == "own_cost":
        low = [float(number) for number in re.findall(rf"by {NUMBER} m in all", printed)]
        assert low[1] < 0.2 * low[0], "the term keeps the robot low"
    if name == "moved_object":
        (_, away), radius = re.findall(rf"at {NUMBER} cm", printed), re.findall(rf"is {NUMBER} cm", printed)
        assert float(away) > float(radius[0]), "the second plan passes the ball"


def test_all_examples_are_tested_and_say_what_they_show() -> None:
    scripts = sorted(FOLDER.glob("*.py"))
    assert {path.stem for path in scripts} == set(PROMISES) | LIVE
    for path in scripts:
        text = path.read_text()
        assert text.startswith('"""') and len(text.splitlines()) <= 90, path.name

"""A filter that runs all day must not grow."""

import json
import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.nightly
@pytest.mark.slow
def test_memory_does_not_grow_from_update_to_update() -> None:
    command = [sys.executable, "-m", "tests.estimator.measure_memory", "1200", "3"]
    done = subprocess.run(command, cwd=Path(__file__).parents[2], capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    begin, _, end = map(json.loads, done.stdout.splitlines())
    assert (begin["updates"], end["updates"]) == (400, 1200)
    assert end["traced"] - begin["traced"] < 32 * 800, "something is kept of each update"
    assert end["resident"] - begin["resident"] < 4e6

"""`nerfnav serve` as a process: it tells its address, answers there, and ends with Ctrl-C or when it is terminated."""

import json
import signal
import subprocess
import sys
import time
import urllib.request
from pathlib import Path

import pytest

from tests.waiting import PATIENCE_S, free_port


def answer(url: str) -> int:
    """The status with which a server answers, as soon as it does."""
    until = time.monotonic() + PATIENCE_S
    while True:
        try:
            with urllib.request.urlopen(url, timeout=5) as response:
                return response.status
        except OSError:
            if time.monotonic() > until:
                raise
            time.sleep(0.2)


@pytest.mark.slow
@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGTERM])
def test_it_tells_its_address_answers_there_and_ends_when_it_is_asked_to(
    field_file: Path, ending: signal.Signals
) -> None:
    port = free_port()
    # whoever runs the tests in the background has interrupts ignored, and children inherit that
    heeds = "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler)"
    command = [sys.executable, "-c", f"{heeds}; from nerfnav_app.cli.main import main; sys.exit(main())"]
    command += ["serve", str(field_file), "--port", str(port), "--json"]
    root = Path(__file__).parents[4]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=root) as process:
        assert process.stdout is not None
        reported = json.loads(process.stdout.readline())
        assert reported == {"url": f"http://127.0.0.1:{port}/", "place": str(field_file)}
        assert answer(reported["url"]) == 200
        process.send_signal(ending)
        rest, complaint = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0, complaint
    assert rest == "", "the address is the last line of stdout"
    assert "Traceback" not in complaint


_IN_A_LONG_STEP = """
import os, signal, sys, threading, time
import torch
from nerfnav_app.cli.main import main
from nerfnav_app.worker.worker import Worker

begun = threading.Event()

def compute(worker):
    weights = torch.rand(300, 300, requires_grad=True)
    while True:
        (weights @ weights).sum().backward()
        begun.set()

def end():
    begun.wait()
    os.kill(os.getpid(), signal.SIGTERM)

Worker._run = compute
threading.Thread(target=end, daemon=True).start()
sys.exit(main(["serve", sys.argv[1], "--port", sys.argv[2]]))
"""


@pytest.mark.slow
def test_it_ends_well_in_the_middle_of_a_step_that_goes_on_and_on(field_file: Path) -> None:
    # the interpreter must not be taken down under a thread that is in torch: that aborts (exit code -6)
    command = [sys.executable, "-c", _IN_A_LONG_STEP, str(field_file), str(free_port())]
    ended = subprocess.run(command, capture_output=True, text=True, cwd=Path(__file__).parents[4], timeout=PATIENCE_S)
    assert ended.returncode == 0, ended.stderr
    assert "Traceback" not in ended.stderr

"""`nerfnav serve` as a process: it tells its address, answers there, and ends with Ctrl-C."""

import json
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from pathlib import Path

PATIENCE_S = 60.0


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


def test_it_tells_its_address_answers_there_and_ends_with_an_interrupt(field_file: Path) -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-c", "import sys; from app.cli import main; sys.exit(main())"]
    command += ["serve", str(field_file), "--port", str(port), "--json"]
    root = Path(__file__).parents[2]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=root) as process:
        assert process.stdout is not None
        told = json.loads(process.stdout.readline())
        assert told == {"url": f"http://127.0.0.1:{port}/", "place": str(field_file)}
        assert answer(told["url"]) == 200
        process.send_signal(signal.SIGINT)
        rest, complaint = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0, complaint
    assert rest == "", "the address is the last line of stdout"
    assert "Traceback" not in complaint

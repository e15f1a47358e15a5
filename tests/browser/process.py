"""The app as users have it: a process of its own, whose memory, log and end are its alone."""

import contextlib
import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.waiting import free_port

_ROOT = Path(__file__).parents[2]
_NERFNAV = (sys.executable, "-c", "import sys; from nerfnav_app.cli.main import main; sys.exit(main())")
_STOP_S = 120.0
"""How long the end of a running job and of all threads may take on a machine that is busy with other things [s]."""
_FAULT = re.compile(r"Traceback|ERROR|Exception")
_BEFORE, _TOLD = 500, 6000  # characters of the log that are told before a fault, and in all


@dataclass(frozen=True)
class Served:
    """A running `nerfnav serve`."""

    process: subprocess.Popen[str]
    url: str
    log: Path
    """What it writes on stderr."""

    def memory_mb(self) -> float:
        """What it has in memory now [MB]."""
        lines = Path(f"/proc/{self.process.pid}/status").read_text().splitlines()
        return next(int(line.split()[1]) / 1024 for line in lines if line.startswith("VmRSS"))

    def cpu_s(self) -> float:
        """How long it has computed, on all cores together [s]."""
        times = Path(f"/proc/{self.process.pid}/stat").read_text().rsplit(")", 1)[1].split()
        return (int(times[11]) + int(times[12])) / os.sysconf("SC_CLK_TCK")

    def complaints(self) -> list[str]:
        """Its log from a little before the first fault that it speaks of; empty where it speaks of none."""
        log = self.log.read_text(errors="replace")
        fault = _FAULT.search(log)
        if fault is None:
            return []
        start = max(0, fault.start() - _BEFORE)
        return [f"{self.log} says:\n{log[start : start + _TOLD]}"]


def done(*arguments: str) -> None:
    """Run `nerfnav` with these arguments to its end, which must be a good one; what it keeps goes with it."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(
            [*_NERFNAV, *arguments], stdout=subprocess.DEVNULL, cwd=_ROOT, env=_keeping_in(folder), check=True
        )


def _keeping_in(folder: str) -> dict[str, str]:
    """The environment of a process that keeps runs and places there."""
    return os.environ | {f"NERFNAV_{kept.upper()}": str(Path(folder) / kept) for kept in ("runs", "places")}


@contextlib.contextmanager
def served(*arguments: str, log: Path, cores: set[int] | None = None) -> Iterator[Served]:
    """Run `nerfnav serve` with these arguments, on these cores alone; `log` keeps its stderr. It must end well."""
    with tempfile.TemporaryDirectory() as folder:
        words = ["serve", *arguments, "--port", str(free_port()), "--json"]
        with log.open("w") as stream:
            process = subprocess.Popen(
                [*_NERFNAV, *words],
                stdout=subprocess.PIPE,
                stderr=stream,
                text=True,
                cwd=_ROOT,
                env=_keeping_in(folder),
            )
            if cores is not None:
                os.sched_setaffinity(process.pid, cores)
            try:
                assert process.stdout is not None
                yield Served(process, json.loads(process.stdout.readline())["url"], log)
            finally:
                process.terminate()
                code = process.wait(_STOP_S)
        assert code == 0, log.read_text(errors="replace")[-2000:]

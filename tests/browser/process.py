"""The app as users have it: a process of its own, whose memory, log and end are its alone."""

import contextlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.app.security.hostile import free_port

_ROOT = Path(__file__).parents[2]


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
        """The lines of its log that speak of faults."""
        lines = self.log.read_text(errors="replace").splitlines()
        return [line for line in lines if "Traceback" in line or "ERROR" in line or "Exception" in line]


@contextlib.contextmanager
def served(*arguments: str, cores: set[int] | None = None) -> Iterator[Served]:
    """Run `nerfnav serve` with these arguments, on these cores alone; it must end well."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log"
        words = ["serve", *arguments, "--port", str(free_port()), "--json"]
        command = [sys.executable, "-c", "import sys; from app.cli.main import main; sys.exit(main())", *words]
        with log.open("w") as stream:
            process = subprocess.Popen(
                command,
                stdout=subprocess.PIPE,
                stderr=stream,
                text=True,
                cwd=_ROOT,
                env=os.environ | {"NERFNAV_RUNS": str(Path(folder) / "runs")},
            )
            if cores is not None:
                os.sched_setaffinity(process.pid, cores)
            try:
                assert process.stdout is not None
                yield Served(process, json.loads(process.stdout.readline())["url"], log)
            finally:
                process.terminate()
                code = process.wait(60)
        assert code == 0, log.read_text(errors="replace")[-2000:]

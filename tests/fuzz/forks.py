"""Runs of the command in forks of one warm process, as a start takes seconds and a fork milliseconds.

    python -m tests.fuzz.forks FOLDER        reads requests and writes findings, a line of JSON each

The process uses one core, so that it has no pool of threads that a fork would lose. Each run has limits on memory and
time; what it read must be the same afterwards.
"""

import gc
import hashlib
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import traceback
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from tests.fuzz.mutations import damage

_MEMORY = 3 << 30
"""Address space that a run may take beyond that of the warm process [bytes]."""
_CPU_S, _WALL_S = 60, 240
"""Time of one run."""
_CRASHED = 70
"""Exit code of a run that ended in an exception."""
_LONGEST_SENTENCE = 1000


@dataclass(frozen=True)
class Finding:
    """Run that did not end as it should."""

    kind: str
    seed: int
    index: int
    """Number of the input; -1 for the undamaged one."""
    file: str
    """File that was damaged."""
    what: str
    """What happened instead of success or one sentence."""
    words: list[str]
    """Command line, on the damaged input, which is kept."""
    said: str
    """End of what it printed on stderr."""

    @property
    def as_text(self) -> str:
        """Report of the finding."""
        command = " ".join(self.words)
        return f"{self.kind} {self.index} ({self.file}): {self.what}\n  nerfnav {command}\n  {self.said}"


class Server:
    """Makes inputs of the kinds, damages them, and runs the command on each, in a folder."""

    def __init__(self, folder: Path) -> None:
        """Begin with an empty folder."""
        from tests.fuzz.kinds import FIELD, write_field

        self._folder = folder
        self._log = folder / "stderr"
        self._field = folder / FIELD
        folder.mkdir(parents=True, exist_ok=True)
        write_field(self._field)

    def run(self, kind: str, seed: int, count: int) -> list[Finding]:
        """Run the command on `count` damaged inputs of a kind."""
        valid = self._folder / kind / "valid"
        findings = self._warm(kind, valid, seed)
        for index in range(count if not findings else 0):
            finding = self._damaged(kind, valid, seed, index)
            findings += [] if finding is None else [finding]
        return findings

    def _warm(self, kind: str, valid: Path, seed: int) -> list[Finding]:
        """Make the undamaged input, and run the command on it in this process, so that forks find all imported."""
        from tests.fuzz.kinds import KINDS

        if valid.is_dir():
            return []
        valid.mkdir(parents=True)
        shutil.copy(self._field, valid / self._field.name)
        KINDS[kind].make(valid)
        words = KINDS[kind].command(valid, self._out(kind, 0))
        code = self._recorded(words)
        what = _judge(code, self._log.read_text(errors="replace"), _names_in(valid, kind))
        if what is None and code == 0:
            return []
        return [Finding(kind, seed, -1, "undamaged", what or f"exit code {code}", words, self._end())]

    def _damaged(self, kind: str, valid: Path, seed: int, index: int) -> Finding | None:
        from tests.fuzz.kinds import KINDS

        chance = random.Random(f"{kind} {seed} {index}")
        case = valid.with_name(f"{seed}-{index}")
        shutil.copytree(valid, case)
        files = sorted(path for pattern in KINDS[kind].damaged for path in case.glob(pattern) if path.is_file())
        file = chance.choice(files)
        file.write_bytes(damage(file.name, file.read_bytes(), chance))
        before, words = _digests(case), KINDS[kind].command(case, self._out(kind, index))
        code = self._forked(words)
        what = _judge(code, self._log.read_text(errors="replace"), _names_in(case, kind))
        if what is None and _digests(case) != before:
            what = "an input file changed"
        if what is None:
            shutil.rmtree(case)
            return None
        return Finding(kind, seed, index, str(file.relative_to(case)), what, words, self._end())

    def _out(self, kind: str, index: int) -> Path:
        """Empty folder for what a run writes."""
        out = self._folder / "out"
        shutil.rmtree(out, ignore_errors=True)
        (out / f"{kind}{index}").mkdir(parents=True)
        return out / f"{kind}{index}"

    def _forked(self, words: Sequence[str]) -> int:
        """Exit code of a run in a fork; the negative number of the signal that ended it."""
        child = os.fork()
        if child == 0:
            try:
                gc.disable()  # which would touch, and so copy, all memory of the warm process
                _limit()
                os._exit(self._recorded(words))
            finally:
                os._exit(_CRASHED)
        _, status = os.waitpid(child, 0)
        return os.waitstatus_to_exitcode(status)

    def _recorded(self, words: Sequence[str]) -> int:
        """Run the command in this process, and put what it prints on stderr into the log."""
        from nerfnav_app.cli.main import main

        kept = os.dup(1), os.dup(2)
        sys.stdout.flush()
        with self._log.open("wb") as log, open(os.devnull, "wb") as nothing:
            os.dup2(nothing.fileno(), 1)
            os.dup2(log.fileno(), 2)
        try:
            return main(words)
        except BaseException:
            traceback.print_exc()
            return _CRASHED
        finally:
            with suppress(Exception):
                sys.stdout.flush()
                sys.stderr.flush()
            for number, old in enumerate(kept, 1):
                os.dup2(old, number)
                os.close(old)

    def _end(self) -> str:
        return "\n  ".join(self._log.read_text(errors="replace").strip().splitlines()[-8:])


def _shorten_searches() -> None:
    """Give searches of poses few candidates and steps: inputs are tried here, not how well a pose is found."""
    from nerfnav.estimator.relocalize.global_localization import RelocaliseConfig
    from nerfnav.estimator.relocalize.panorama import PanoramaConfig
    from nerfnav.tracking.camera_check import CameraCheckConfig

    short = {
        "kept": (2, 2, 1, 1), "iterations": (2, 2, 1, 1), "attempts": 1, "pixels": 64, "settling_pixels": 64,
        "restarts": 1,
    }  # fmt: skip
    few = {"spacing": 0.6, "pitches": (0.0,), "rolls": (0.0,), "most_places": 8}
    once = {"tried": (0.0,), "frames": 1}
    for kind, fixed in ((RelocaliseConfig, short), (PanoramaConfig, few), (CameraCheckConfig, once)):
        _fix_fields(kind, fixed)


def _fix_fields(kind: type, fixed: Mapping[str, object]) -> None:
    """Let a record have the same values in some of its fields, whatever it is made with."""
    make = kind.__init__  # type: ignore[misc]

    def make_fixed(self: object, **fields: object) -> None:
        make(self, **{**fields, **fixed})

    kind.__init__ = make_fixed  # type: ignore[misc]



def _limit() -> None:
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    most = pages * resource.getpagesize() + _MEMORY
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    used = resource.getrusage(resource.RUSAGE_SELF)
    seconds = int(used.ru_utime + used.ru_stime) + _CPU_S
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    signal.alarm(_WALL_S)


def _judge(code: int, said: str, names: set[str]) -> str | None:
    """Say what is wrong with an end; None for success, and for one sentence that names the input."""
    if code == _CRASHED or "Traceback (most recent call last)" in said:
        return "a traceback"
    if code in (-signal.SIGXCPU, -signal.SIGALRM, -signal.SIGKILL):
        return f"a hang, ended after {_CPU_S} s of work or {_WALL_S} s"
    if code < 0:
        return f"a crash by signal {-code}"
    if code not in (0, 2):
        return f"exit code {code}"
    if code == 0:
        return None
    sentence = said[said.find("nerfnav: ") :].strip()
    if not said.lstrip().startswith("nerfnav: ") or len(sentence.splitlines()) > 2:
        return "more than one sentence"
    if len(sentence) > _LONGEST_SENTENCE:
        return f"a sentence of {len(sentence)} characters"
    return None if any(name in sentence for name in names) else "a sentence that does not name the file"


def _names_in(folder: Path, kind: str) -> set[str]:
    """Names of the files and folders of an input, and what else a sentence about its kind may name."""
    from tests.fuzz.kinds import KINDS

    return {path.name for path in folder.rglob("*")} | set(KINDS[kind].about)


def _digests(folder: Path) -> dict[Path, bytes]:
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {path: hashlib.blake2b(path.read_bytes()).digest() for path in files}


class Forks:
    """Warm process that runs requests; started with the first of them."""

    def __init__(self, folder: Path) -> None:
        """Let the process work in a folder."""
        single = {"OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
        single["OPENCV_FFMPEG_LOGLEVEL"] = "-8"  # as nerfnav sets it, but before the tests write a video
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.fuzz.forks", str(folder)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=os.environ | single,
            cwd=Path(__file__).parents[2],
        )  # fmt: skip

    def run(self, kind: str, seed: int, count: int) -> list[Finding]:
        """Run the command on damaged inputs of a kind. Raises EOFError where the process died."""
        assert self._process.stdin is not None and self._process.stdout is not None
        self._process.stdin.write(json.dumps({"kind": kind, "seed": seed, "count": count}) + "\n")
        self._process.stdin.flush()
        line = self._process.stdout.readline()
        if not line:
            raise EOFError(f"the warm process ended with {self._process.wait()} at the kind {kind}")
        return [Finding(**finding) for finding in json.loads(line)]

    def close(self) -> None:
        """End the process."""
        self._process.communicate()


def _serve(folder: Path) -> None:
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})  # kernels then use no pool of threads
    _shorten_searches()
    server = Server(folder)
    for line in sys.stdin:
        request: dict[str, Any] = json.loads(line)
        print(json.dumps([asdict(finding) for finding in server.run(**request)]), flush=True)


if __name__ == "__main__":
    _serve(Path(sys.argv[1]))

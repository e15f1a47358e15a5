"""Step log of a flight: write its steps as they are flown, one line of JSON each, and read them back.

Each step is on disk at once: kill -9 costs at most one of them. app/storage/step_codec.py has the format.
"""

import json
from collections.abc import Callable
from contextlib import AbstractContextManager, closing, nullcontext, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from filelock import BaseFileLock, FileLock, Timeout

from nerfnav.core.errors import InvalidInputError, first_line
from nerfnav.navigation import Episode, NavigationStep
from nerfnav.robots import RigidState
from nerfnav_app.places.ends import End
from nerfnav_app.storage import run_metadata
from nerfnav_app.storage.output_files import OutputError
from nerfnav_app.storage.step_codec import FILE, PICTURES, decode_step, encode_step, keep_picture


def count_steps(folder: Path) -> int:
    """Time steps in a log, the start not counted; 0 where there is none."""
    try:
        with (folder / FILE).open("rb") as stream:
            return max(0, sum(line.endswith(b"\n") for line in stream) - 1)
    except OSError:
        return 0


def read_steps(folder: Path, pictures: bool = True) -> tuple[NavigationStep, ...]:
    """The steps of a log; a last line that is cut off counts as not written.

    Raises InvalidInputError where there is no step, or something else than steps.
    """
    try:
        *lines, rest = (folder / FILE).read_text().split("\n")
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidInputError(f"{folder.name} holds no readable log of a flight") from error
    del rest  # empty, or cut off
    try:
        steps = tuple(decode_step(json.loads(line), folder if pictures else None) for line in lines)
        for index, step in enumerate(steps):
            shape = steps[0].plan.actions.shape[1:] if index else None
            if step.index != index or (None if step.action is None else step.action.shape) != shape:
                raise ValueError(f"line {index + 1} is no step {index} with an action of {shape}")
            if step.plan.dt != steps[0].plan.dt or step.plan.actions.shape[1:] != steps[0].plan.actions.shape[1:]:
                raise ValueError(f"line {index + 1} has another dt or kind of action than the first")
    except (ValueError, KeyError, RuntimeError, InvalidInputError) as error:
        raise InvalidInputError(f"{FILE} of {folder.name} is damaged: {first_line(error)}") from error
    if not steps:
        raise InvalidInputError(f"{folder.name} was cut off before its first step")
    return steps


_LEAST_STEPS = 2  # a flight that never left the start is not kept


class StepLog:
    """Writes the steps of one flight."""

    def __init__(
        self, folder: Path, flight: run_metadata.RunMetadata, numbers: Callable[[Episode], dict[str, Any]]
    ) -> None:
        """`folder` exists; what an earlier flight left there is replaced. `numbers` are the metrics of a flight.

        Raises OutputError where another flight is being written there.
        """
        self._folder, self._about, self._numbers = folder, flight, numbers
        self._steps: list[NavigationStep] = []
        self._lock = lock_for(folder / FILE)
        try:
            self._lock.acquire()
        except Timeout as error:
            raise OutputError(f"another flight is being written into {folder.name}: choose another folder") from error
        self._stream = (folder / FILE).open("w")
        for old in (folder / PICTURES).glob("*.jpg"):
            old.unlink()
        flight.save(folder)

    def append(self, step: NavigationStep) -> None:
        """Write one step down. Raises OutputError where the disk does not take it."""
        try:
            picture = None if step.image is None else keep_picture(self._folder, step.image, step.index)
            self._stream.write(json.dumps(encode_step(step) | {"picture": picture}) + "\n")
            self._stream.flush()
        except OSError as error:
            raise OutputError(f"the flight cannot be written into {self._folder.name}: {error.strerror}") from error
        self._steps.append(step)

    def note_operator(self, goal: RigidState | None, requests: tuple[str, ...]) -> None:
        """Note where the flight goes now, and the operator's requests so far, in words.

        A flight whose goal was moved is no flight of its task any more.
        """
        self._about = replace(self._about, requests=requests)
        if goal is not None:
            self._about = self._about.with_goal(End.of_state(goal))

    def close(self) -> None:
        """Write into run.json how the flight ended; one that never left the start leaves nothing behind."""
        if len(self._steps) < _LEAST_STEPS:
            self._discard()
        else:
            episode = Episode.of(self._steps)
            outcome = episode.outcome.name.lower()
            replace(self._about, outcome=outcome, metrics=self._numbers(episode)).save(self._folder)
        self._stream.close()
        with suppress(OSError):  # systems differ in whether a file can be removed while it is open
            Path(self._lock.lock_file).unlink(missing_ok=True)
        self._lock.release()

    def _discard(self) -> None:
        pictures = self._folder / PICTURES
        lock = Path(self._lock.lock_file)
        for path in (self._folder / FILE, self._folder / run_metadata.FILE, lock, *pictures.glob("*.jpg")):
            path.unlink(missing_ok=True)
        for folder in (pictures, self._folder):
            if folder.is_dir() and not any(folder.iterdir()):
                folder.rmdir()


def open_step_log(
    folder: Path | None, flight: run_metadata.RunMetadata, numbers: Callable[[Episode], dict[str, Any]]
) -> AbstractContextManager[StepLog | None]:
    """A log in `folder`; None writes nothing. However the flight ends, what was flown stays."""
    return nullcontext() if folder is None else closing(StepLog(folder, flight, numbers))


def lock_for(path: Path) -> BaseFileLock:
    """The lock of a file that is written for a while, FILE.lock beside it, not taken yet.

    Taking it raises filelock.Timeout, an OSError, at once where it is held.
    """
    return FileLock(path.with_name(f"{path.name}.lock"), blocking=False, thread_local=False)


def is_locked(path: Path) -> bool:
    """Check whether a process is writing a file; False too where its lock may not be opened."""
    lock = lock_for(path)
    if not Path(lock.lock_file).is_file():
        return False
    try:
        with lock:
            return False
    except Timeout:
        return True
    except OSError:
        return False

"""The steps of a flight, one line of JSON each, on disk as soon as they are flown: kill -9 costs at most one of them.

steps.jsonl     index, time [s], action, truth and belief as 18 numbers (position, velocity, rotation row by row, body
                rate), covariance (144 numbers), plan (states, actions), what it took, outcome, recovery
pictures/       the camera's picture of each step as JPEG

Numbers have nine digits, which is every bit of a float32. What the filter compared is not kept.
"""

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch
from filelock import Timeout
from torch import Tensor

from app.storage import run_metadata as about
from app.storage.file_lock import lock_of
from app.storage.output_files import OutputError
from app.storage.run_metadata import RunMetadata
from nerfnav.errors import InvalidInputError
from nerfnav.estimator.belief import Belief
from nerfnav.geometry.images import picture_file
from nerfnav.navigation.episode import Episode
from nerfnav.navigation.recovery import Recovery
from nerfnav.navigation.steps import EpisodeOutcome, NavigationStep
from nerfnav.robots.state import Motion, RigidState

FILE, PICTURES = "steps.jsonl", "pictures"
_JPEG_QUALITY = 90
_LEAST_STEPS = 2  # a flight that never left the start is not kept


class StepLog:
    """Writes the steps of one flight."""

    def __init__(self, folder: Path, flight: RunMetadata, numbers: Callable[[Episode], dict[str, Any]]) -> None:
        """`folder` exists; what an earlier flight left there is replaced. `numbers` are the metrics of a flight.

        Raises OutputError where another flight is being written there.
        """
        self._folder, self._about, self._numbers = folder, flight, numbers
        self._steps: list[NavigationStep] = []
        self._lock = lock_of(folder / FILE)
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
            picture = None if step.image is None else self._keep(step.image, step.index)
            self._stream.write(json.dumps(_content(step) | {"picture": picture}) + "\n")
            self._stream.flush()
        except OSError as error:
            raise OutputError(f"the flight cannot be written into {self._folder.name}: {error.strerror}") from error
        self._steps.append(step)

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
        for path in (self._folder / FILE, self._folder / about.FILE, lock, *pictures.glob("*.jpg")):
            path.unlink(missing_ok=True)
        for folder in (pictures, self._folder):
            if folder.is_dir() and not any(folder.iterdir()):
                folder.rmdir()

    def _keep(self, image: Tensor, index: int) -> str:
        (self._folder / PICTURES).mkdir(exist_ok=True)
        name = f"{PICTURES}/{index:05}.jpg"
        (self._folder / name).write_bytes(picture_file(image.numpy(), _JPEG_QUALITY))
        return name


@contextmanager
def logged(
    folder: Path | None, flight: RunMetadata, numbers: Callable[[Episode], dict[str, Any]]
) -> Iterator[StepLog | None]:
    """A log in `folder`; None writes nothing. However the flight ends, what was flown stays."""
    if folder is None:
        yield None
        return
    log = StepLog(folder, flight, numbers)
    try:
        yield log
    finally:
        log.close()


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
        steps = tuple(_step(json.loads(line), folder if pictures else None) for line in lines)
    except (ValueError, KeyError, TypeError, RuntimeError) as error:
        raise InvalidInputError(f"the log of {folder.name} is damaged: {error}") from error
    if not steps:
        raise InvalidInputError(f"{folder.name} was cut off before its first step")
    return steps


def _content(step: NavigationStep) -> dict[str, Any]:
    return {
        "index": step.index,
        "time": step.time,
        "action": None if step.action is None else _numbers(step.action),
        "truth": _numbers(_flat(step.truth)),
        "belief": _numbers(_flat(step.belief.mean)),
        "covariance": _numbers(step.belief.covariance),
        "plan": {
            "states": _numbers(_flat(step.plan.states)),
            "actions": _numbers(step.plan.actions),
            "shape": list(step.plan.actions.shape),
            "dt": step.plan.dt,
        },
        "touched": step.touched,
        "filter_ms": step.filter_ms,
        "replan_ms": step.replan_ms,
        "outcome": None if step.outcome is None else step.outcome.name.lower(),
        "recovery": None if step.recovery is None else step.recovery.name.lower(),
    }


def _step(content: dict[str, Any], folder: Path | None) -> NavigationStep:
    plan, action = content["plan"], content["action"]
    states = _state(torch.tensor(plan["states"]).reshape(-1, 18))
    actions = torch.tensor(plan["actions"]).reshape(plan["shape"])
    outcome, recovery = content["outcome"], content["recovery"]
    return NavigationStep(
        index=int(content["index"]),
        time=float(content["time"]),
        action=None if action is None else torch.tensor(action),
        truth=_state(torch.tensor(content["truth"])),
        belief=Belief(_state(torch.tensor(content["belief"])), torch.tensor(content["covariance"]).reshape(12, 12)),
        image=None if folder is None or content["picture"] is None else _picture(folder, content["index"]),
        update=None,
        plan=Motion(states, actions, float(plan["dt"])),
        touched=bool(content["touched"]),
        filter_ms=float(content["filter_ms"]),
        replan_ms=float(content["replan_ms"]),
        outcome=None if outcome is None else EpisodeOutcome[outcome.upper()],
        recovery=None if recovery is None else Recovery[recovery.upper()],
    )


def _picture(folder: Path, index: int) -> Tensor | None:
    """The picture of a step; None where the file is gone or is none."""
    path = folder / PICTURES / f"{int(index):05}.jpg"
    bgr = cv2.imread(str(path), cv2.IMREAD_COLOR) if path.is_file() else None
    return None if bgr is None else torch.from_numpy(np.ascontiguousarray(bgr[..., ::-1]))


def _flat(state: RigidState) -> Tensor:
    return torch.cat([state.position, state.velocity, state.rotation.flatten(-2), state.body_rate], -1)


def _state(flat: Tensor) -> RigidState:
    position, velocity, rotation, rate = flat.split([3, 3, 9, 3], -1)
    return RigidState(position, velocity, rotation.unflatten(-1, (3, 3)), rate)


def _numbers(tensor: Tensor) -> Sequence[float]:
    return [float(f"{value:.9g}") for value in tensor.detach().reshape(-1).tolist()]

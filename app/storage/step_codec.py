"""Step codec: a time step of a flight to a line of JSON, and back.

steps.jsonl     index, time [s], action, truth and belief as 18 numbers (position, velocity, rotation row by row, body
                rate), covariance (144 numbers), plan (states, actions), what it took, outcome, recovery, late,
                gust_mps where there was a gust, transition where the supervisor's state changed, seen where a robot
                that watches has seen movers: 12 numbers for each of their boxes (position at time 0 of the flight,
                rotation, extents, velocity); index 0 also has the first plan, which versions before did not keep
pictures/       the camera's picture of each step as JPEG

Numbers have nine digits, which is every bit of a float32. The pixels of the filter are not kept.
"""

import math
from pathlib import Path
from typing import Any

import cv2
import msgspec
import numpy as np
import torch
from torch import Tensor

from nerfnav.estimator import Belief
from nerfnav.geometry import encode_image
from nerfnav.navigation import EpisodeOutcome, NavigationStep, StateChange, SupervisorAction
from nerfnav.obstacles import BoxShape, ConstantVelocity, Obstacle
from nerfnav.planner import Movers
from nerfnav.robots import Motion, RigidState

FILE, PICTURES = "steps.jsonl", "pictures"
"""Where steps and their pictures are in the folder of a flight."""
_JPEG_QUALITY = 90


def encode_step(step: NavigationStep) -> dict[str, Any]:
    """Encode a step; its picture is a file of its own."""
    first = {} if step.first_plan is None else {"first_plan": _encode_motion(step.first_plan)}
    return {
        "index": step.index,
        "time": step.time,
        "action": None if step.action is None else _numbers(step.action),
        "truth": _numbers(_flat(step.truth)),
        "belief": _numbers(_flat(step.belief.mean)),
        "covariance": _numbers(step.belief.covariance),
        "plan": _encode_motion(step.plan),
        "touched": step.touched,
        "filter_ms": step.filter_ms,
        "replan_ms": step.replan_ms,
        "outcome": None if step.outcome is None else step.outcome.name.lower(),
        "recovery": None if step.recovery is None else step.recovery.name.lower(),
        "late": step.late,
        **first,
    } | {
        **({} if step.gust_mps is None else {"gust_mps": step.gust_mps}),
        **({} if step.change is None else {"transition": step.change.to_json()}),
        **({} if step.seen_movers is None else {"seen": _encode_boxes(step.seen_movers)}),
    }


def keep_picture(folder: Path, image: Tensor, index: int) -> str:
    """Write the picture of a step into the folder of a flight. Its path within that."""
    (folder / PICTURES).mkdir(exist_ok=True)
    name = f"{PICTURES}/{index:05}.jpg"
    (folder / name).write_bytes(encode_image(image.numpy(), _JPEG_QUALITY))
    return name


class _StoredMotion(msgspec.Struct):
    """Motion as a line holds it: states of 18 numbers each, actions row by row."""

    states: list[float]
    actions: list[float]
    shape: tuple[int, int]
    dt: float


class _StoredStep(msgspec.Struct):
    """Step as a line holds it (see `encode_step`)."""

    index: int
    time: float
    action: list[float] | None
    truth: list[float]
    belief: list[float]
    covariance: list[float]
    plan: _StoredMotion
    touched: bool
    filter_ms: float
    replan_ms: float
    outcome: str | None
    recovery: str | None
    picture: str | None = None
    late: bool = False
    gust_mps: float | None = None
    transition: dict[str, int | str] | None = None
    first_plan: _StoredMotion | None = None
    seen: list[list[float]] | None = None


def decode_step(content: dict[str, Any], folder: Path | None) -> NavigationStep:
    """Decode a step as it was written, with its picture where `folder` is given.

    Raises ValueError, KeyError or RuntimeError for what is none. A belief may be NaN, as a filter that diverged has it.
    """
    step = msgspec.convert(content, _StoredStep)
    _require_finite("time", step.time)
    return NavigationStep(
        index=step.index,
        time=step.time,
        action=None if step.action is None else _finite("action", step.action),
        truth=_state(_finite("truth", step.truth)),
        belief=Belief(_state(torch.tensor(step.belief)), torch.tensor(step.covariance).reshape(12, 12)),
        image=None if folder is None or step.picture is None else _picture(folder, step.index),
        update=None,
        plan=_decode_motion("plan", step.plan),
        touched=step.touched,
        filter_ms=step.filter_ms,
        replan_ms=step.replan_ms,
        outcome=None if step.outcome is None else EpisodeOutcome[step.outcome.upper()],
        change=None if step.transition is None else StateChange.from_json(step.transition),
        recovery=None if step.recovery is None else SupervisorAction[step.recovery.upper()],
        late=step.late,
        gust_mps=step.gust_mps,
        first_plan=None if step.first_plan is None else _decode_motion("first_plan", step.first_plan),
        kept_movers=None if step.seen is None else _decode_boxes(step.seen),
    )


_LARGEST = 1e6
"""Largest number of a state or an action, in its unit: no robot is so far, so fast or so strong."""


def _require_finite(name: str, *numbers: float) -> None:
    for index, number in enumerate(numbers):
        if not abs(number) <= _LARGEST:
            raise ValueError(f"{name}[{index}] is {number:g}, not a number up to {_LARGEST:g}")


def _finite(name: str, numbers: list[float]) -> Tensor:
    _require_finite(name, *numbers)
    return torch.tensor(numbers, dtype=torch.float32)


def _encode_motion(motion: Motion) -> dict[str, Any]:
    return {
        "states": _numbers(_flat(motion.states)),
        "actions": _numbers(motion.actions),
        "shape": list(motion.actions.shape),
        "dt": motion.dt,
    }


def _decode_motion(name: str, stored: _StoredMotion) -> Motion:
    states = _state(_finite(f"{name}.states", stored.states).reshape(-1, 18))
    if not 0 < stored.dt < math.inf or len(states.position) != stored.shape[0] + 1:
        raise ValueError(f"{name} has {len(states.position)} states, {stored.shape[0]} actions and a dt of {stored.dt}")
    return Motion(states, _finite(f"{name}.actions", stored.actions).reshape(stored.shape), stored.dt)


def _encode_boxes(movers: Movers) -> list[list[float]]:
    boxes = []
    for mover in movers.obstacles:
        assert isinstance(mover.shape, BoxShape) and isinstance(mover.motion, ConstantVelocity), "what is seen is a box"
        parts = mover.position, mover.rotation, mover.shape.extents, mover.motion.velocity
        boxes.append([float(f"{number:.9g}") for part in parts for number in part])
    return boxes


def _decode_boxes(stored: list[list[float]]) -> Movers:
    boxes = []
    for index, numbers in enumerate(stored):
        _require_finite(f"seen[{index}]", *numbers)
        x, y, z, roll, pitch, yaw, length, width, height, u, v, w = numbers
        shape, motion = BoxShape((length, width, height)), ConstantVelocity((u, v, w))
        boxes.append(Obstacle(f"seen {index + 1}", shape, (x, y, z), (roll, pitch, yaw), motion))
    if not boxes:
        raise ValueError("seen has no box")
    return Movers(tuple(boxes))


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


def _numbers(tensor: Tensor) -> list[float]:
    return [float(f"{value:.9g}") for value in tensor.detach().reshape(-1).tolist()]

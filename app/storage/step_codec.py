"""Step codec: a time step of a flight to a line of JSON, and back.

steps.jsonl     index, time [s], action, truth and belief as 18 numbers (position, velocity, rotation row by row, body
                rate), covariance (144 numbers), plan (states, actions), what it took, outcome, recovery, late,
                gust_mps where there was a gust, transition where the supervisor's state changed; index 0 also has the
                first plan, which versions before did not keep
pictures/       the camera's picture of each step as JPEG

Numbers have nine digits, which is every bit of a float32. The pixels of the filter are not kept.
"""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch
from torch import Tensor

from nerfnav.estimator import Belief
from nerfnav.geometry import encode_image
from nerfnav.navigation import EpisodeOutcome, NavigationStep, StateChange, SupervisorAction
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
    }


def keep_picture(folder: Path, image: Tensor, index: int) -> str:
    """Write the picture of a step into the folder of a flight. Its path within that."""
    (folder / PICTURES).mkdir(exist_ok=True)
    name = f"{PICTURES}/{index:05}.jpg"
    (folder / name).write_bytes(encode_image(image.numpy(), _JPEG_QUALITY))
    return name


def decode_step(content: dict[str, Any], folder: Path | None) -> NavigationStep:
    """A step as it was written, with its picture where `folder` is given."""
    action, first = content["action"], content.get("first_plan")
    outcome, recovery, transition = content["outcome"], content["recovery"], content.get("transition")
    return NavigationStep(
        index=int(content["index"]),
        time=float(content["time"]),
        action=None if action is None else torch.tensor(action),
        truth=_state(torch.tensor(content["truth"])),
        belief=Belief(_state(torch.tensor(content["belief"])), torch.tensor(content["covariance"]).reshape(12, 12)),
        image=None if folder is None or content["picture"] is None else _picture(folder, content["index"]),
        update=None,
        plan=_decode_motion(content["plan"]),
        touched=bool(content["touched"]),
        filter_ms=float(content["filter_ms"]),
        replan_ms=float(content["replan_ms"]),
        outcome=None if outcome is None else EpisodeOutcome[outcome.upper()],
        change=None if transition is None else StateChange.from_json(transition),
        recovery=None if recovery is None else SupervisorAction[recovery.upper()],
        late=bool(content.get("late", False)),
        gust_mps=content.get("gust_mps"),
        first_plan=None if first is None else _decode_motion(first),
    )


def _encode_motion(motion: Motion) -> dict[str, Any]:
    return {
        "states": _numbers(_flat(motion.states)),
        "actions": _numbers(motion.actions),
        "shape": list(motion.actions.shape),
        "dt": motion.dt,
    }


def _decode_motion(content: dict[str, Any]) -> Motion:
    states = _state(torch.tensor(content["states"]).reshape(-1, 18))
    return Motion(states, torch.tensor(content["actions"]).reshape(content["shape"]), float(content["dt"]))


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

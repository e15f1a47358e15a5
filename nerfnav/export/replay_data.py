"""What a replay shows, as values of JSON."""

import base64
import math
from typing import Any

import torch
from torch import Tensor

from nerfnav.export.recording import Recording
from nerfnav.export.surface import Surface
from nerfnav.geometry import ellipsoid_95, picture_file
from nerfnav.navigation import NavigationStep
from nerfnav.robots import POSITION, RigidState

_JPEG_QUALITY = 82
_DIGITS = 5


def replay_data(recording: Recording) -> dict[str, Any]:
    last = recording.steps[-1]
    return {
        "title": recording.title,
        "robot": recording.table.info.get("robot", ""),
        "dt": last.plan.dt,
        "outcome": last.outcome.value if last.outcome is not None else "the flight was not finished",
        "extents": list(recording.extents),
        "steps": [_step(step) for step in recording.steps],
        "surface": None if recording.surface is None else Surface.of_glb(recording.surface).thinned().packed(),
    }


def _step(step: NavigationStep) -> dict[str, Any]:
    mean = step.belief.mean
    variance = step.belief.covariance.diagonal()[POSITION].clamp_min(0)
    axes, half = ellipsoid_95(step.belief.covariance[POSITION, POSITION])
    return {
        "truth": _pose(step.truth),
        "belief": _pose(mean),
        "ellipsoid": _rounded((axes * half).reshape(-1)),
        "plan": _rounded(step.plan.states.position.reshape(-1)),
        "touched": step.touched,
        "error": _finite((step.truth.position - mean.position).norm().item()),
        "sigma": _finite(variance.sum().sqrt().item()),
        "filter": _finite(step.filter_ms),
        "replan": _finite(step.replan_ms),
        "picture": None if step.image is None else _picture(step.image),
    }


def _pose(state: RigidState) -> list[float]:
    return _rounded(torch.cat([state.position, state.rotation.reshape(-1)]))


def _rounded(numbers: Tensor) -> list[float]:
    return [round(value, _DIGITS) for value in numbers.detach().double().nan_to_num(0.0, 0.0, 0.0).tolist()]


def _finite(value: float) -> float | None:
    return round(value, _DIGITS) if math.isfinite(value) else None


def _picture(image: Tensor) -> str:
    """sRGB bytes (h, w, 3) as a data URL."""
    return "data:image/jpeg;base64," + base64.b64encode(picture_file(image.numpy(), _JPEG_QUALITY)).decode()

"""A flight as one HTML file that needs neither server nor network: the place, the flight, a timeline.

replay.html is the page; what it shows is put in its place as JSON:

    title, robot, dt [s], outcome, extents [m]
    steps: for each time truth and belief as (position [m], R_world_body row by row), the 95 % ellipsoid as the
        matrix that makes it of the unit ball, the plan's positions, and the numbers of the step
    surface: the place's surface, thinned (nerfnav.export.surface)
"""

import base64
import json
import math
from importlib.resources import files
from typing import Any

import torch
from torch import Tensor

from nerfnav.errors import InvalidInputError
from nerfnav.export.recording import Exported, Recording
from nerfnav.export.surface import Surface
from nerfnav.geometry.ellipsoid import ellipsoid_95
from nerfnav.geometry.images import picture_file
from nerfnav.navigation.steps import NavigationStep
from nerfnav.robots.state import POSITION, RigidState

_JPEG_QUALITY = 82
_DIGITS = 5
_PLACE = "/*REPLAY*/null"


def replay(recording: Recording) -> Exported:
    """The page. Raises InvalidInputError for a plan, which has nothing to replay."""
    if not recording.steps:
        raise InvalidInputError("only flights can be replayed: fly the plan first")
    page = (files("nerfnav.export") / "replay.html").read_text(encoding="utf-8")
    # a name that holds "</script>" must not end the script
    data = json.dumps(_data(recording), allow_nan=False).replace("<", "\\u003c")
    pictures = sum(step.image is not None for step in recording.steps)
    info = {"steps": len(recording.steps), "pictures": pictures, "has_surface": recording.surface is not None}
    return Exported(page.replace(_PLACE, data, 1).encode(), info)


def _data(recording: Recording) -> dict[str, Any]:
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

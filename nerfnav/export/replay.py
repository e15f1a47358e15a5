"""Replay: a flight as one HTML file that needs neither server nor network, with its place and a timeline.

replay.html is the page; what it shows is put in its place as JSON:

    title, robot, dt [s], outcome, extents [m]
    steps: for each time truth and belief as (position [m], R_world_body row by row), the 95 % ellipsoid as the
        matrix that makes it of the unit ball, the plan's positions, and the numbers of the step
    surface: the place's surface, made small enough for a page: vertices that share a cell of a grid become one

Clustering after Rossignac and Borrel, "Multi-resolution 3D approximations for rendering complex scenes" (1993).
"""

import base64
import json
import math
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import cv2
import numpy as np
import torch
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.glb import parts
from nerfnav.export.recording import Exported, Recording
from nerfnav.geometry import ellipsoid_95, encode_image, to_linear, to_srgb, tone_map
from nerfnav.navigation import NavigationStep
from nerfnav.robots import POSITION, RigidState

_FLOAT, _UINT16, _UINT32 = 5126, 5123, 5125
_MOST_VERTICES = 45_000
_FINEST, _COARSER = 256, 1.15  # cells along the longest edge to begin with; how much larger cells become each time


@dataclass(frozen=True)
class Surface:
    """Surface mesh with vertex colours."""

    points: np.ndarray
    """(n, 3), world axes [m]."""
    colors: np.ndarray
    """(n, 3), linear, 0 to 1."""
    triangles: np.ndarray
    """(m, 3), numbers of points."""

    @classmethod
    def of_glb(cls, glb: bytes) -> "Surface":
        """The first mesh of a binary glTF with a picture of light before tone mapping (see nerfnav/geometry/color.py).

        Raises InvalidInputError for anything else.
        """
        try:
            document, binary = parts(glb)
            primitive = document["meshes"][0]["primitives"][0]
            names = primitive["attributes"]
            points, uv, indices = (
                _array(document, binary, n) for n in (names["POSITION"], names["TEXCOORD_0"], primitive["indices"])
            )
            picture = _texture(document, binary)
            material = document["materials"][primitive["material"]]
            brightest = np.array(material["pbrMetallicRoughness"]["baseColorFactor"][:3])
        except (ValueError, KeyError, IndexError) as error:
            raise InvalidInputError(f"this is no binary glTF of a mesh with a picture: {error}") from error
        column, row = (uv / 65535.0 * picture.shape[1::-1]).astype(np.int64).T
        inside = np.minimum(row, picture.shape[0] - 1), np.minimum(column, picture.shape[1] - 1)
        return cls(points, tone_map(brightest * to_linear(picture[inside] / 255.0)), indices.reshape(-1, 3))

    def thinned(self, most: int = _MOST_VERTICES) -> "Surface":
        """The same with at most `most` vertices, each the mean of those in its cell."""
        if len(self.points) <= most:
            return self
        low, size = self.points.min(0), float(np.ptp(self.points, axis=0).max())
        cells, coarse = float(_FINEST), self
        while len(coarse.points) > most:
            coarse = self._clustered(np.floor((self.points - low) / size * cells).astype(np.int64))
            cells /= _COARSER
        return coarse

    def _clustered(self, cells: np.ndarray) -> "Surface":
        _, cluster, sizes = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
        cluster = cluster.reshape(-1)

        def mean(values: np.ndarray) -> np.ndarray:
            columns = [np.bincount(cluster, values[:, i], len(sizes)) for i in range(values.shape[1])]
            return np.stack(columns, -1) / sizes[:, None]

        triangles = cluster[self.triangles]
        a, b, c = triangles.T
        return Surface(mean(self.points), mean(self.colors), triangles[(a != b) & (b != c) & (c != a)])

    def packed(self) -> dict[str, Any]:
        """For a page: points as 16 bits within a box, colours as 8 bits of sRGB, triangles as 32 bits; base64."""
        low = self.points.min(0)
        size = np.maximum(np.ptp(self.points, axis=0), 1e-9)
        arrays = {
            "points": np.round(65535 * (self.points - low) / size).astype("<u2"),
            "colors": np.round(255 * to_srgb(self.colors)).astype(np.uint8),
            "triangles": self.triangles.astype("<u4"),
        }
        texts = {name: base64.b64encode(array.tobytes()).decode() for name, array in arrays.items()}
        return texts | {"low": low.tolist(), "size": size.tolist()}


def _array(document: dict[str, Any], binary: bytes, number: int) -> np.ndarray:
    accessor = document["accessors"][number]
    kind = {_FLOAT: "<f4", _UINT16: "<u2", _UINT32: "<u4"}[accessor["componentType"]]
    width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}[accessor["type"]]
    start = document["bufferViews"][accessor["bufferView"]].get("byteOffset", 0)
    flat = np.frombuffer(binary, kind, accessor["count"] * width, start)
    return flat.reshape(-1, width).astype(np.int64 if kind == "<u4" else np.float64)


def _texture(document: dict[str, Any], binary: bytes) -> np.ndarray:
    """The first picture, sRGB bytes (h, w, 3)."""
    view = document["bufferViews"][document["images"][0]["bufferView"]]
    start = view.get("byteOffset", 0)
    content = np.frombuffer(binary[start : start + view["byteLength"]], np.uint8)
    picture = cv2.imdecode(content, cv2.IMREAD_COLOR)
    if picture is None:
        raise ValueError("its picture cannot be read")
    return picture[..., ::-1]


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
    return "data:image/jpeg;base64," + base64.b64encode(encode_image(image.numpy(), _JPEG_QUALITY)).decode()


_PLACE = "/*REPLAY*/null"


def replay(recording: Recording) -> Exported:
    """Export the page. Raises InvalidInputError for a plan."""
    if not recording.steps:
        raise InvalidInputError("only flights can be replayed: fly the plan first")
    page = (files("nerfnav.export") / "replay.html").read_text(encoding="utf-8")
    # a name that holds "</script>" must not end the script
    data = json.dumps(replay_data(recording), allow_nan=False).replace("<", "\\u003c")
    info = {
        "steps": len(recording.steps),
        "pictures": sum(step.image is not None for step in recording.steps),
        "has_surface": recording.surface is not None,
    }
    return Exported(page.replace(_PLACE, data, 1).encode(), info)

"""Mission of QGroundControl (.plan): waypoints in degrees, for flights by satellite navigation.

A world in metres has no geographic coordinates: its origin's latitude, longitude and height (the datum) must be
given, and its y axis points north. In the plane that touches the ellipsoid of WGS 84 there, with the radii of curvature
M of the meridian and N of the prime vertical,

    latitude = lat_0 + north / (M + h)        longitude = lon_0 + east / ((N + h) cos lat_0)

Waypoints are the corners of the path, simplified (Ramer, Douglas and Peucker). Satellite navigation is off by metres:
do not fly plans between walls this way.
"""

import json
import math

import numpy as np
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.export.curves import Curve, curve_of
from nerfnav.export.recording import Exported, Recording
from nerfnav.export.setpoints import yaw_ned_of_enu
from nerfnav.planner import PiecewisePolynomial

_SEMI_MAJOR, _ECCENTRICITY_2 = 6378137.0, 6.69437999014e-3
"""Of WGS 84: a [m] and e^2."""
_WAYPOINT, _GLOBAL_FRAME, _ABSOLUTE = 16, 0, 2
"""MAV_CMD_NAV_WAYPOINT, MAV_FRAME_GLOBAL, QGroundControl's mode of altitudes above sea level."""
_OFF_M = 0.02
"""Largest distance of the path from the lines between waypoints [m]."""
_SAMPLE_S = 0.05
_PACE_MPS = 1
"""The mission's speed [m/s]."""


def qgroundcontrol(recording: Recording) -> Exported:
    """The mission. Raises InvalidInputError without a datum, or where it is no place on Earth."""
    latitude, longitude, height = _datum(recording)
    curve = curve_of(recording)
    rows = _corners(curve)
    curvature = 1 - _ECCENTRICITY_2 * math.sin(math.radians(latitude)) ** 2
    meridian = _SEMI_MAJOR * (1 - _ECCENTRICITY_2) / curvature**1.5 + height
    vertical = (_SEMI_MAJOR / math.sqrt(curvature) + height) * math.cos(math.radians(latitude))
    items = [
        _item(number, yaw, (latitude + math.degrees(y / meridian), longitude + math.degrees(x / vertical), height + z))
        for number, (x, y, z, yaw) in enumerate(rows.tolist(), 1)
    ]
    content = {
        "fileType": "Plan", "version": 1, "groundStation": "nerfnav",
        "nerfnav": {"title": recording.title, "motion": curve.motion, "outcome": recording.outcome or "not known"},
        "geoFence": {"circles": [], "polygons": [], "version": 2}, "rallyPoints": {"points": [], "version": 2},
        "mission": {
            "version": 2, "firmwareType": 0, "vehicleType": 2, "cruiseSpeed": _PACE_MPS, "hoverSpeed": _PACE_MPS,
            "items": items,
            "globalPlanAltitudeMode": _ABSOLUTE, "plannedHomePosition": [latitude, longitude, height],
        },
    }  # fmt: skip
    info = {"waypoints": len(items), "motion": curve.motion, "datum": [latitude, longitude, height]}
    return Exported((json.dumps(content, indent=1) + "\n").encode(), info, _straight(rows))


def _datum(recording: Recording) -> tuple[float, float, float]:
    if recording.datum is None:
        raise InvalidInputError(
            "QGroundControl counts in degrees: say where on Earth the origin is, --datum LATITUDE LONGITUDE HEIGHT"
        )
    latitude, longitude, height = recording.datum
    if not (abs(latitude) < 89.9 and abs(longitude) <= 180 and math.isfinite(height)):
        raise InvalidInputError(
            "a datum is a latitude within 89.9 degrees, a longitude within 180 degrees and a height in m, "
            f"not {recording.datum}"
        )
    return recording.datum


def _corners(curve: Curve) -> np.ndarray:
    """x, y, z [m] and yaw [rad] of the waypoints, (n, 4)."""
    samples = curve.at(np.linspace(0, curve.duration, max(2, math.ceil(curve.duration / _SAMPLE_S))))
    kept, spans = {0, len(samples) - 1}, [(0, len(samples) - 1)]
    while spans:
        first, last = spans.pop()
        between = samples[first + 1 : last, :3] - samples[first, :3]
        if not len(between):
            continue
        chord = samples[last, :3] - samples[first, :3]
        share = np.clip(between @ chord / max(chord @ chord, 1e-12), 0, 1)
        off = np.linalg.norm(between - share[:, None] * chord, axis=-1)
        if off.max() > _OFF_M:
            middle = first + 1 + int(off.argmax())
            kept.add(middle)
            spans += [(first, middle), (middle, last)]
    return samples[sorted(kept)]


def _straight(rows: np.ndarray) -> PiecewisePolynomial:
    """Lines between waypoints (n, 4), at a constant and slow speed: only the path counts."""
    spans = np.maximum(np.linalg.norm(np.diff(rows[:, :3], axis=0), axis=-1) / _PACE_MPS, _SAMPLE_S)
    coefficients = np.stack([rows[:-1], np.diff(rows, axis=0)], 1)
    return PiecewisePolynomial(torch.from_numpy(np.append(0.0, spans.cumsum())), torch.from_numpy(coefficients))


def _item(number: int, yaw: float, place: tuple[float, float, float]) -> dict[str, object]:
    heading = math.degrees(yaw_ned_of_enu(torch.tensor(yaw)).item()) % 360
    return {
        "type": "SimpleItem", "command": _WAYPOINT, "frame": _GLOBAL_FRAME, "doJumpId": number, "autoContinue": True,
        "Altitude": place[2], "AltitudeMode": _ABSOLUTE, "AMSLAltAboveTerrain": None,
        "params": [0, 0, 0, heading, *place],
    }  # fmt: skip

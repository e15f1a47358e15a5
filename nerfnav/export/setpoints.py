"""Setpoints at a steady rate along a smooth curve, and how autopilots count axes and headings.

Autopilots work in local NED axes (x north, y east, z down) and measure headings clockwise from north; the library works
in ENU (x east, y north, z up), headings counter-clockwise from east. So

    (north, east, down) = (y, x, -z)        yaw_ned = pi / 2 - yaw_enu, wrapped to (-pi, pi]

for positions, velocities, accelerations and jerks alike; the origin is that of the world, so the local frame of the
vehicle must have its origin there, and its north along the world's y axis.
"""

from collections.abc import Iterable, Sequence

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.export.crazyflie import demands_of
from nerfnav.export.curves import Curve, curve_of, quadrotor_of
from nerfnav.export.flatness import QuadrotorLimits
from nerfnav.export.recording import Recording
from nerfnav.export.tables import csv_lines

RATE_HZ = 50
"""Setpoints in a second."""
_MICROSECONDS = 10**6


def setpoints_of(recording: Recording) -> tuple[Curve, np.ndarray]:
    """Sample the curve: setpoint times [us] every 1 / RATE_HZ s, and its end."""
    curve = curve_of(recording)
    end = round(curve.duration * _MICROSECONDS)
    period = _MICROSECONDS // RATE_HZ
    return curve, np.append(np.arange(0, end - period // 2, period), end)


def ned_rows(curve: Curve, times_us: np.ndarray) -> dict[str, np.ndarray]:
    """Position, velocity, acceleration and jerk in NED (n, 3), heading and its rate (n,), at times [us]."""
    seconds = np.minimum(times_us / _MICROSECONDS, curve.duration)
    derivatives = [torch.from_numpy(curve.at(seconds, order)) for order in range(4)]
    names = ("position", "velocity", "acceleration", "jerk")
    rows = {name: ned_of_enu(values[:, :3]).numpy() for name, values in zip(names, derivatives, strict=True)}
    return rows | {"yaw": yaw_ned_of_enu(derivatives[0][:, 3]).numpy(), "yawspeed": -derivatives[1][:, 3].numpy()}


def describe_setpoints(recording: Recording, curve: Curve) -> dict[str, object]:
    """Describe the setpoints of an export."""
    return {
        "frame": "NED", "rate_hz": RATE_HZ, "motion": curve.motion,
        "stretched_by": curve.stretched_by, "off_rows_m": curve.off_m,
        **demands_of(curve.shape, QuadrotorLimits.of(quadrotor_of(recording))),
    }  # fmt: skip


def csv_of(comment: str, header: Sequence[str], rows: Iterable[Sequence[float]]) -> bytes:
    """A line that begins with #, the names of the columns, and the rows: nine decimals, and never a "-0"."""
    cells = ([cell_of(value) for value in row] for row in rows)
    return (f"# {comment}\n" + csv_lines([header, *cells])).encode()


def cell_of(value: float) -> str:
    """A number in few characters; whole numbers as such."""
    rounded = round(float(value), 9) + 0.0  # adding 0 takes the sign from -0
    return str(int(rounded)) if rounded.is_integer() else f"{rounded:.12g}"


def ned_of_enu(vectors: Float[Tensor, "*batch 3"]) -> Float[Tensor, "*batch 3"]:
    """(x, y, z) in ENU as (north, east, down); its own inverse."""
    return torch.stack([vectors[..., 1], vectors[..., 0], -vectors[..., 2]], -1)


def yaw_ned_of_enu(yaw: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
    """A heading counter-clockwise from east as one clockwise from north, in (-pi, pi] [rad]; its own inverse."""
    turned = torch.pi / 2 - yaw
    return turned - 2 * torch.pi * torch.ceil((turned - torch.pi) / (2 * torch.pi))
